"""Locks on files between processes: the second one gets an error at once."""

from __future__ import annotations

import os
import threading
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

try:
    import fcntl
except ImportError:  # another system than Linux or macOS: nothing is locked
    fcntl = None  # type: ignore[assignment]

_owners: dict[str, int] = {}
"""Lock file -> thread of this process that holds it."""


@contextmanager
def exclusive(file: Path, busy: Exception) -> Iterator[None]:
    """Hold the lock of a file for a block; the same thread may hold it several times over.

    The file is made for that and removed at the end; a process that dies lets go. Where files cannot be made or locked,
    as on some network file systems, nothing is locked.

    Args:
        file: beside what is protected, or in it; `busy`: raised when another process or thread holds the lock.
    """
    place = os.path.abspath(file)
    if _owners.get(place) == threading.get_ident():
        yield
        return
    stream = _locked(file, busy)
    if stream is None:
        yield
        return
    _owners[place] = threading.get_ident()
    try:
        yield
    finally:
        del _owners[place]
        # While it is still locked: a process that opened it meanwhile finds it gone.
        with suppress(OSError):
            os.unlink(place)
        os.close(stream)


def _locked(file: Path, busy: Exception) -> int | None:
    """Open and lock the file, and return its descriptor; None where that cannot be done."""
    if fcntl is None:
        return None
    while True:
        try:
            stream = os.open(file, os.O_RDWR | os.O_CREAT | os.O_CLOEXEC, 0o666)
        except OSError:
            return None
        try:
            fcntl.flock(stream, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            os.close(stream)
            raise busy from None
        except OSError:
            os.close(stream)
            return None
        with suppress(OSError):
            if os.path.samestat(os.fstat(stream), os.stat(file)):
                return stream
        os.close(stream)  # Its holder removed it between opening and locking.
