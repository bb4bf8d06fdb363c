"""Transactions of a backend, and a memory of what they read that other processes' changes clear."""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterator, Sequence
from contextlib import contextmanager, nullcontext
from threading import RLock
from typing import TypeVar

from sqlalchemy import Connection

from kpred.database.backend import Backend
from kpred.database.cache import BoundedCache, DatabaseCache
from kpred.errors import DatabaseError

Value = TypeVar("Value")
Read = Callable[[Connection, Sequence[str]], dict[str, Value]]
"""Reads the values of some keys in a transaction."""


class CachedReads:
    """An open backend with the values read from it, all of one version of its content; threads may share it."""

    def __init__(self, backend: Backend) -> None:
        self.backend = backend
        self.cache = DatabaseCache()
        self._open = True
        self._lock = RLock()

    def close(self) -> None:
        """Close the backend and drop all values; closing twice does nothing."""
        with self._lock:
            self._open = False
            self.cache.clear()
            self.backend.close()

    @contextmanager
    def transaction(self, write: bool = False, exclusive: bool = False) -> Iterator[Connection]:
        """Hold a transaction; values of another version are dropped before it, and all after a write.

        Raises:
            DatabaseError: the database is closed, or cannot be read or written.
        """
        with self._lock if self.backend.one_at_a_time else nullcontext():
            if not self._open:
                raise DatabaseError(f"Database {self.backend.path} is closed; open it again.")
            with self.backend.transaction(write, exclusive) as connection:
                version = self.backend.version(connection)
                if version != self.cache.version:  # another process has written
                    self._clear_cache()
                    self.cache.version = version
                try:
                    yield connection
                finally:
                    if write:
                        self._clear_cache()

    def cached(self, cache: BoundedCache[Value], keys: Sequence[str], read: Read[Value]) -> dict[str, Value]:
        """Return values by key: from the cache if it is current, else `read` in a transaction and cached.

        Raises:
            DatabaseError: a key is not in the database, or this is closed or cannot be read.
        """
        with self._lock:
            version = self.cache.version
            if self._open and version is not None and self.backend.peek_version() == version:
                found = cache.get(keys)
                if len(found) == len(set(keys)):
                    return found
        with self.transaction() as connection:  # clears an outdated cache
            version = self.cache.version
            found = cache.get(keys)
            missing = [key for key in dict.fromkeys(keys) if key not in found]
            if missing:
                values = read(connection, missing)
                self.check_known(missing, values)
                if version == self.cache.version:  # else another thread has seen a newer version meanwhile
                    cache.put(values)
                found |= values
            return found

    def check_known(self, model_ids: Collection[str], found: Collection[str]) -> None:
        """Check that all models were found.

        Raises:
            DatabaseError: one was not.
        """
        unknown = sorted(set(model_ids).difference(found))
        if unknown:
            raise DatabaseError(
                f"Database {self.backend.path} has no model {unknown[0]!r}; 'kpred database info' lists its content."
            )

    def _clear_cache(self) -> None:
        with self._lock:
            self.cache.clear()
