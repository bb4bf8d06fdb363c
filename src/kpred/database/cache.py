"""What an open database keeps in memory, as of one version of what is stored."""

from __future__ import annotations

from collections.abc import Collection

from kpred.database.candidates import ModelCache
from kpred.database.entry import Entry
from kpred.database.rows import FittingArrays
from kpred.database.search import Index

MOST_ARRAYS, MOST_ENTRIES = 4096, 128
"""Models whose points and basis, and whose meshes too, are kept: 150 kB and a few hundred kB each."""

MOST_VERTICES = 16_384
"""Larger meshes are read again each time."""


class Kept:
    """Names of categories, what they are searched by, and what was read of models last; threads may share it.

    Attributes:
        version: of what is stored, that all of this is of; None before anything was read.
    """

    def __init__(self) -> None:
        self.version: object = None
        self.categories: tuple[str, ...] | None = None
        self.indices: dict[str, Index] = {}
        self.arrays: ModelCache[FittingArrays] = ModelCache(MOST_ARRAYS)
        self._entries: ModelCache[Entry] = ModelCache(MOST_ENTRIES)

    def entry(self, model_id: str) -> Entry | None:
        """A model, if it is kept."""
        return self._entries.get([model_id]).get(model_id)

    def put_entry(self, entry: Entry) -> None:
        """Keep a model, unless its mesh is large."""
        if len(entry.mesh.vertices) <= MOST_VERTICES:
            self._entries.put({entry.model_id: entry})

    def has_arrays(self, model_ids: Collection[str]) -> bool:
        """Whether points and basis of all these models are kept."""
        return len(self.arrays.get(model_ids)) == len(set(model_ids))

    def forget(self) -> None:
        """All but the version: something was written."""
        self.categories = None
        self.indices.clear()
        self.arrays.clear()
        self._entries.clear()
