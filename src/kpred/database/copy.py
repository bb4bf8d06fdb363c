"""Copy of a database, from file to server or back: in batches, resumable, verified bit by bit."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack
from dataclasses import dataclass

from kpred.database.database import Database
from kpred.errors import DatabaseError

_BATCH = 64


@dataclass(frozen=True)
class CopyReport:
    """What a copy did: models copied now, models that were there before, models compared afterwards."""

    copied: int
    present: int
    verified: int


def copy_database(
    source: str | os.PathLike[str],
    target: str | os.PathLike[str],
    *,
    batch: int = _BATCH,
    progress: Callable[[str, int, int], None] | None = None,
) -> CopyReport:
    """Copy all models of one database into another, which is made where there is none, and compare them.

    Rows are copied as they are stored. Every `batch` models are one transaction; models that are there already are
    compared, not copied, so that a copy that was killed goes on. Models that only `target` has stay there.

    Args:
        progress: called with "copying" or "verifying", the models done, and the models to do.

    Raises:
        DatabaseError: one of them cannot be used, they are the same, weights differ, or a model differs in the two.
    """
    with ExitStack() as stack:
        left = stack.enter_context(Database.open(source, read_only=True))
        right = stack.enter_context(Database.open(target) if Database.exists(target) else Database.create(target))
        if str(left.path) == str(right.path):
            raise DatabaseError(f"Database {left.path} cannot be copied onto itself; give another place.")
        names = left.model_ids()
        present = set(right.model_ids())
        missing = [name for name in names if name not in present]
        for done, part in _parts(missing, batch):
            right.add_records(left.records(part))
            if progress is not None:
                progress("copying", done, len(missing))
        for done, part in _parts(names, batch):
            for one, other in zip(left.records(part), right.records(part), strict=True):
                if one.digest() != other.digest():
                    raise DatabaseError(
                        f"Database {right.path}: its {one.model_id} is not that of {left.path}; remove it there, "
                        "and copy again."
                    )
            if progress is not None:
                progress("verifying", done, len(names))
    return CopyReport(len(missing), len(names) - len(missing), len(names))


def _parts(names: Sequence[str], size: int) -> Iterator[tuple[int, Sequence[str]]]:
    for start in range(0, len(names), size):
        part = names[start : start + size]
        yield start + len(part), part
