"""Whole-or-nothing writing of one file."""

from __future__ import annotations

import os
import secrets
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from kpred.errors import OutputError


def check_place(path: str | os.PathLike[str]) -> None:
    """Refuse a file that cannot be written, before any work is done for it; nothing is written.

    Raises:
        OutputError: the folder is missing or not writable, or ``path`` is a folder.
    """
    target = Path(path)
    if target.is_dir():
        raise OutputError(f"Cannot write {target}: it is a folder; give the name of a file in it.")
    if not target.parent.is_dir():
        raise OutputError(f"Cannot write {target}: the folder {target.parent} does not exist; make it first.")
    if not os.access(target.parent, os.W_OK | os.X_OK):
        raise OutputError(f"Cannot write {target}: you may not write into {target.parent}; choose another folder.")


@contextmanager
def atomic_path(path: str | os.PathLike[str]) -> Iterator[Path]:
    """Yield a temporary path beside ``path``; when the block ends well, it takes the place of ``path``.

    The temporary name ends with the same extension, so writers that go by the extension work. When the block fails,
    the temporary file is removed and an existing ``path`` stays as it was.

    Raises:
        OutputError: the folder is missing or not writable, the disk is full, or ``path`` is a folder.
    """
    target = Path(path)
    check_place(target)
    temporary = target.with_name(f".{target.stem[:64]}.{os.getpid()}.{secrets.token_hex(4)}{target.suffix}")
    try:
        yield temporary
        # Without fsync a crash right after the rename may leave an empty file under the final name.
        with open(temporary, "rb+") as stream:
            os.fsync(stream.fileno())
        os.replace(temporary, target)
    except OSError as error:
        reason = error.strerror or str(error)
        raise OutputError(f"Cannot write {target}: {reason}; free the disk or choose another folder.") from error
    finally:
        temporary.unlink(missing_ok=True)
