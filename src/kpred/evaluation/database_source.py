"""The database that an evaluation searches: a given one, or one built from the source shapes of mesh packs."""

from __future__ import annotations

import hashlib
import os
import tempfile
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path

from kpred.database import Database, build_database
from kpred.errors import OutputError, PackError
from kpred.file_hash import file_sha256
from kpred.nn import Model
from kpred.shapes import open_shapes

SOURCE_SPLIT = "source"

Progress = Callable[[str, int, int], None]
"""Called with (what is being done, done, total)."""


@contextmanager
def database_source(
    files: Sequence[Path],
    model: Model,
    database: Database | str | os.PathLike[str] | None,
    seed: int,
    progress: Callable[[int], None] | None,
    report: Callable[[str], None],
    cache: Path | None = None,
) -> Iterator[Database]:
    """Open the given database, or build a temporary one of the packs' source shapes; it is closed at the end.

    With a `cache` folder the database that is built stays there, under a name made of packs, weights and seed; it is
    taken from there the next time, and one that was not finished is gone on with.

    Raises:
        OutputError: the cache folder cannot be made.
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
        with _place(files, model, seed, cache) as path:
            shapes = (shape for file in files for shape in open_shapes(file, split=SOURCE_SPLIT, report=report))
            built = build_database(path, shapes, model, seed=seed, progress=progress)
            for model_id, reason in built.failed:
                report(f"left out of the database: {model_id}: {reason}")
            with Database.open(path, read_only=True) as store:
                yield store


@contextmanager
def _place(files: Sequence[Path], model: Model, seed: int, cache: Path | None) -> Iterator[Path]:
    """Choose where the database is built: in a folder that is removed at the end, or in the cache."""
    if cache is None:
        with tempfile.TemporaryDirectory(prefix="kpred-") as folder:
            yield Path(folder) / "source.kpred"
        return
    try:
        cache.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise OutputError(f"Cannot make the folder {cache}: {error.strerror}; choose another.") from error
    made_of = [content_hash(file) for file in files]
    made_of += [f"{category} {network.fingerprint()}" for category, network in sorted(model.items())]
    name = hashlib.sha256("\n".join([*made_of, str(seed)]).encode()).hexdigest()[:16]
    yield cache / f"{'-'.join(file.stem for file in files)}-{name}.kpred"


def content_hash(file: Path) -> str:
    """SHA-256 of a file's bytes, in hexadecimal.

    Raises:
        PackError: it cannot be read.
    """
    try:
        return file_sha256(file)
    except OSError as error:
        raise PackError(f"{file}: it cannot be read ({error.strerror or error}); check the path.") from error


def counter(progress: Progress | None, name: str, total: int) -> Callable[[int], None] | None:
    """Make a counter of one task for a `Progress`."""
    return None if progress is None else lambda done: progress(name, done, total)
