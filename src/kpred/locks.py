"""Locks on files between processes: the second one gets an error at once."""

from __future__ import annotations

import os
import sys
import threading
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

if sys.platform == "win32":
    import msvcrt
else:
    import fcntl

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
        # Windows removes no file that is open.
        with suppress(OSError):
            if sys.platform == "win32":
                os.unlink(place)


def take_lock(stream: int) -> None:
    """Lock an open file for this process until it is closed, or raise BlockingIOError if another one holds it.

    Raises:
        OSError: files cannot be locked there.
    """
    if sys.platform == "win32":
        try:
            msvcrt.locking(stream, msvcrt.LK_NBLCK, 1)
        except PermissionError as error:
            raise BlockingIOError(*error.args) from error
    else:
        fcntl.flock(stream, fcntl.LOCK_EX | fcntl.LOCK_NB)


def _locked(file: Path, busy: Exception) -> int | None:
    """Open and lock the file, and return its descriptor; None where that cannot be done."""
    while True:
        try:
            stream = os.open(file, os.O_RDWR | os.O_CREAT | getattr(os, "O_CLOEXEC", 0), 0o666)
        except OSError:
            return None
        try:
            take_lock(stream)
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
