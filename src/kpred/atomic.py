"""Whole-or-nothing writing of one file, and of several files together."""

from __future__ import annotations

import os
import secrets
import shutil
from collections.abc import Callable, Iterator, Mapping
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
    temporary = _beside(target)
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


def write_together(files: Mapping[Path, Callable[[Path], object]]) -> None:
    """Write several files, all of them or none.

    Each value writes the file of its key under the name it is called with, which lies beside it and has its extension.
    Only when all have been written do they take their places, in the mapping's order; if one of these cannot, the
    others are taken back, and what was there before is there again.

    Raises:
        OutputError: a file cannot be written there; the message names it.
    """
    staged: dict[Path, Path] = {}
    before: dict[Path, Path] = {}
    placed: list[Path] = []
    try:
        for target, write in files.items():
            check_place(target)
            staged[target] = temporary = _beside(target)
            with _named(target, temporary):
                write(temporary)
                with open(temporary, "rb+") as stream:
                    os.fsync(stream.fileno())
        for target, temporary in staged.items():
            with _named(target, temporary):
                if target.exists():
                    before[target] = _beside(target)
                    _keep(target, before[target])
                os.replace(temporary, target)
            placed.append(target)
    except BaseException:
        for target in placed:
            if target in before:
                os.replace(before.pop(target), target)
            else:
                target.unlink(missing_ok=True)
        raise
    finally:
        for leftover in (*staged.values(), *before.values()):
            leftover.unlink(missing_ok=True)


def _keep(target: Path, before: Path) -> None:
    try:
        os.link(target, before)  # The file stays where it is until the new one takes its place.
    except OSError:
        shutil.copy2(target, before)


def _beside(target: Path) -> Path:
    return target.with_name(f".{target.stem[:64]}.{os.getpid()}.{secrets.token_hex(4)}{target.suffix}")


@contextmanager
def _named(target: Path, temporary: Path) -> Iterator[None]:
    """Attribute errors about a temporary file to its final name."""
    try:
        yield
    except OutputError as error:
        raise OutputError(str(error).replace(str(temporary), str(target))) from error
    except OSError as error:
        reason = error.strerror or str(error)
        raise OutputError(f"Cannot write {target}: {reason}; free the disk or choose another folder.") from error
