"""The folder of a training run: made before the work begins, and held by one process at a time."""

from __future__ import annotations

import os
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from kpred.errors import OutputError
from kpred.locks import exclusive

LOCK_FILE = ".lock"


@contextmanager
def run_folder(folder: Path) -> Iterator[None]:
    """Make a run folder and hold it for a block, which may hold it again; an empty one goes if the block fails.

    Raises:
        OutputError: it cannot be made or written, or another training has it.
    """
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise OutputError(f"Cannot make the run folder {folder}: {error.strerror}; choose another.") from error
    if not os.access(folder, os.W_OK | os.X_OK):
        raise OutputError(f"Cannot write into the run folder {folder}; change its permissions or choose another.")
    busy = OutputError(f"Another training is running in {folder}; wait until it ends, or choose another run folder.")
    try:
        with exclusive(folder / LOCK_FILE, busy):
            yield
    except BaseException:
        with suppress(OSError):
            folder.rmdir()  # only an empty one goes
        raise
