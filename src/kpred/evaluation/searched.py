"""The database that an evaluation searches: a given one, or one built from the source shapes of mesh packs."""

from __future__ import annotations

import os
import tempfile
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path

from kpred.database import Database, build_database
from kpred.nn import Model
from kpred.shapes import open_shapes

SOURCE_SPLIT = "source"

Progress = Callable[[str, int, int], None]
"""Called with (what is being done, done, total)."""


@contextmanager
def searched(
    files: Sequence[Path],
    model: Model,
    database: Database | str | os.PathLike[str] | None,
    seed: int,
    progress: Callable[[int], None] | None,
    report: Callable[[str], None],
) -> Iterator[Database]:
    """The given database, or a temporary one of the source shapes of all these packs; closed at the end if opened here.

    Raises:
        DatabaseError: the given database is missing or was made by other weights.
        PackError: a pack is missing or damaged.
    """
    if isinstance(database, Database):
        database.check_model(model)
        yield database
    elif database is not None:
        with Database.open(database, read_only=True) as store:
            store.check_model(model)
            yield store
    else:
        with tempfile.TemporaryDirectory(prefix="kpred-") as folder:
            path = Path(folder) / "source.kpred"
            shapes = (shape for file in files for shape in open_shapes(file, split=SOURCE_SPLIT, report=report))
            built = build_database(path, shapes, model, seed=seed, progress=progress)
            for model_id, reason in built.failed:
                report(f"left out of the database: {model_id}: {reason}")
            with Database.open(path, read_only=True) as store:
                yield store


def counter(progress: Progress | None, name: str, total: int) -> Callable[[int], None] | None:
    """A `Progress` that knows already what is being done and how much there is."""
    return None if progress is None else lambda done: progress(name, done, total)
