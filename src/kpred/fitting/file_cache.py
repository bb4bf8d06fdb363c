"""Values made from files, kept while the files stay as they are."""

from __future__ import annotations

import os
from collections.abc import Callable, Hashable
from pathlib import Path
from typing import Generic, TypeVar

from kpred.lru_cache import LruCache

Value = TypeVar("Value")


class FileCache(Generic[Value]):
    """The values that were used last, at most `size`, each with the state of the files it was made from."""

    def __init__(self, size: int) -> None:
        self._kept: LruCache[Hashable, tuple[Hashable, Value]] = LruCache(size)

    def get(self, key: Hashable, state: Hashable, make: Callable[[], Value]) -> Value:
        """Return the value of a key, made anew if it is not kept or its files have changed.

        Args:
            state: of the files now; `make` reads them. Two threads that ask at once may both make it.
        """
        kept = self._kept.get(key)
        if kept is not None and kept[0] == state:
            return kept[1]
        value = make()
        self._kept.put(key, (state, value))
        return value

    def __len__(self) -> int:
        return len(self._kept)


def folder_state(folder: Path) -> Hashable:
    """Describe the files below a folder, so that any that is written, replaced or removed makes a difference."""
    found = []
    for place, _, names in os.walk(folder):
        for name in sorted(names):
            found.append((os.path.join(place, name), *_described(Path(place, name))))
    return tuple(sorted(found))


def file_identity(file: Path) -> Hashable:
    """Tell which file is at a place: another one that was put there differs, one that was written to does not.

    A file that is held open keeps its number, so that no other can have it.
    """
    try:
        status = file.stat()
    except OSError:
        return None
    return status.st_dev, status.st_ino


def _described(file: Path) -> tuple[int, ...]:
    try:
        status = file.stat()
    except OSError:
        return ()
    return status.st_ino, status.st_size, status.st_mtime_ns
