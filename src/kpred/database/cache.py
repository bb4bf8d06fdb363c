"""Memory of what an open database has read, valid for one version of its content."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from typing import Generic, TypeVar

from kpred.database.entry import Entry
from kpred.database.rows import FittingArrays
from kpred.database.search import Index
from kpred.lru_cache import LruCache

MAX_ARRAYS, MAX_ENTRIES = 4096, 128
"""Number of models cached: fitting arrays (150 kB each) and whole entries (a few hundred kB each)."""

MAX_VERTICES = 16_384
"""Entries with larger meshes are not cached."""

Value = TypeVar("Value")


class BoundedCache(Generic[Value]):
    """Values by name, at most `capacity` (None: no limit); safe to share between threads."""

    def __init__(self, capacity: int | None = None, accepts: Callable[[Value], bool] = lambda _: True) -> None:
        """Make an empty cache; `accepts`: which values may be cached."""
        self._values: LruCache[str, Value] = LruCache(capacity)
        self._accepts = accepts

    def get(self, names: Iterable[str]) -> dict[str, Value]:
        """Return the cached values among these names."""
        found = ((name, self._values.get(name)) for name in names)
        return {name: value for name, value in found if value is not None}

    def put(self, values: Mapping[str, Value]) -> None:
        """Add the values that may be cached."""
        for name, value in values.items():
            if self._accepts(value):
                self._values.put(name, value)

    def clear(self) -> None:
        """Drop all values."""
        self._values.clear()


class DatabaseCache:
    """What was read, all of the same `version` of the content (None: nothing read)."""

    def __init__(self) -> None:
        self.version: object = None
        self.categories: BoundedCache[tuple[str, ...]] = BoundedCache()
        self.fingerprint: BoundedCache[str] = BoundedCache()
        self.indices: BoundedCache[Index] = BoundedCache()
        self.arrays: BoundedCache[FittingArrays] = BoundedCache(MAX_ARRAYS)
        self.entries: BoundedCache[Entry] = BoundedCache(MAX_ENTRIES, lambda e: len(e.mesh.vertices) <= MAX_VERTICES)

    def clear(self) -> None:
        """Drop all values but keep the version."""
        for cache in (self.categories, self.fingerprint, self.indices, self.arrays, self.entries):
            cache.clear()
