"""Mesh packs of a data set: files read by several processes, each kept by its content, and so read once."""

from __future__ import annotations

import contextlib
import hashlib
import multiprocessing
import os
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import Future, ProcessPoolExecutor, as_completed
from concurrent.futures.process import BrokenProcessPool
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np

from kpred.atomic import atomic_path
from kpred.datasets.check import Issue
from kpred.datasets.dataset import Dataset, ShapeFile, found_in
from kpred.errors import ConfigError, MeshError, OutputError, PackError
from kpred.json_output import write_json
from kpred.parent import end_with_parent
from kpred.shapes.mesh import Mesh
from kpred.shapes.pack import MeshPack

VERSION = 1
"""Goes into the keys of the cache: raise it when the same file gives another mesh."""

CACHE = "cache"
RECORD = "prepared.json"

Progress = Callable[[str, int, int], None]
"""Called with (what is being done, done, total)."""


@dataclass(frozen=True)
class Prepared:
    """What came of a preparation.

    Attributes:
        packs: file of each category's pack.
        found: shapes in the packs, by category and split; skipped: those that could not be read.
        read: meshes read now; kept: those taken from the cache.
    """

    packs: dict[str, Path]
    found: dict[str, dict[str, int]]
    skipped: tuple[Issue, ...]
    read: int
    kept: int

    def to_json(self) -> dict[str, Any]:
        """Return plain values."""
        packs = {category: str(path) for category, path in self.packs.items()}
        return {**asdict(self), "packs": packs, "skipped": [vars(issue) for issue in self.skipped]}


def prepare_dataset(
    dataset: Dataset,
    folder: str | os.PathLike[str],
    workers: int = 2,
    progress: Progress | None = None,
) -> Prepared:
    """Write `folder/<category>.npz` for every category of a data set, and `folder/prepared.json` about them.

    Every mesh that was read lies in `folder/cache` under a name made of the file's content. A preparation that was
    stopped or killed goes on from there; files that have changed are read again. The packs do not depend on the number
    of workers, nor on whether the work was interrupted.

    Args:
        workers: processes that read; 1 reads in this one.

    Raises:
        PackError: the data set has no shapes, or none that can be read.
        OutputError: the folder cannot be written.
        MeshError: a process that read was killed.
        ConfigError: fewer than one worker.
    """
    if workers < 1:
        raise ConfigError(f"Preparing needs at least 1 worker, but has {workers}.")
    shapes = list(dataset.shapes())
    place = Path(folder)
    try:
        (place / CACHE).mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise OutputError(f"Cannot make the folder {place / CACHE}: {error.strerror}; choose another.") from error
    keys: list[str | None] = [None] * len(shapes)
    skipped: dict[int, Issue] = {}
    fresh = 0
    for done, (index, outcome) in enumerate(_outcomes(shapes, place / CACHE, workers), start=1):
        if outcome.reason:
            skipped[index] = Issue("mesh", shapes[index].model_id, outcome.reason)
        else:
            keys[index] = outcome.key
            fresh += outcome.fresh
        if progress is not None:
            progress("reading meshes", done, len(shapes))
    usable = [index for index, key in enumerate(keys) if key is not None]
    if not usable:
        raise PackError(
            f"{dataset.path}: none of its {len(shapes)} meshes can be read; {next(iter(skipped.values())).why}"
        )
    packs: dict[str, Path] = {}
    categories = sorted({shapes[index].category for index in usable})
    for done, category in enumerate(categories, start=1):
        rows = [index for index in usable if shapes[index].category == category]
        packs[category] = place / f"{_file_name(category)}.npz"
        _pack([shapes[row] for row in rows], [place / CACHE / f"{keys[row]}.npz" for row in rows], category).save(
            packs[category]
        )
        if progress is not None:
            progress("writing packs", done, len(categories))
    found = found_in([shapes[index] for index in usable])
    issues = tuple(skipped[index] for index in sorted(skipped))
    result = Prepared(packs, found, issues, fresh, len(usable) - fresh)
    record = {"kind": dataset.kind, "found": found, "skipped": [vars(issue) for issue in issues]}
    write_json(place / RECORD, record)
    return result


@dataclass(frozen=True)
class _Outcome:
    """Outcome for one file: its mesh's cache key and whether it was read now, or the failure."""

    key: str = ""
    fresh: bool = False
    reason: str = ""


def _outcomes(shapes: Sequence[ShapeFile], cache: Path, workers: int) -> Iterator[tuple[int, _Outcome]]:
    """Yield position and outcome of every shape, in order of completion."""
    if workers == 1 or len(shapes) < 2:
        yield from ((index, _cached(shape, cache)) for index, shape in enumerate(shapes))
        return
    # Threads of libraries that were used before do not survive a fork.
    context = multiprocessing.get_context("spawn")
    size = min(workers, len(shapes))
    with ProcessPoolExecutor(size, context, initializer=end_with_parent, initargs=(os.getpid(),)) as pool:
        waiting: dict[Future[_Outcome], int] = {}
        try:
            for index, shape in enumerate(shapes):
                waiting[pool.submit(_cached, shape, cache)] = index
            for future in as_completed(waiting):
                yield waiting[future], future.result()
        except BrokenProcessPool as error:
            raise MeshError(
                f"{cache.parent}: a process that read meshes died, likely for want of memory; give the same command "
                "with --workers 1, what was read is kept."
            ) from error
        except BaseException:
            pool.shutdown(wait=False, cancel_futures=True)
            raise


def _cached(shape: ShapeFile, cache: Path) -> _Outcome:
    """Read one file into the cache, unless its content is there."""
    try:
        key = _key(shape)
        file = cache / f"{key}.npz"
        if file.is_file():
            return _Outcome(key)
        mesh = shape.read()
    except (MeshError, OSError) as error:
        return _Outcome(reason=str(error))
    arrays = {"vertices": mesh.vertices, "faces": mesh.faces}
    if mesh.face_parts is not None:
        arrays["face_parts"] = mesh.face_parts
    with atomic_path(file) as temporary, open(temporary, "xb") as stream:
        np.savez(stream, **arrays)  # type: ignore[arg-type]
    return _Outcome(key, fresh=True)


def _key(shape: ShapeFile) -> str:
    """Hash the content of the file, and all settings that affect reading."""
    digest = hashlib.sha256(f"{VERSION} {shape.file_frame} {shape.path.suffix.lower()}\n".encode())
    with open(shape.path, "rb") as stream:
        while block := stream.read(1 << 20):
            digest.update(block)
    return digest.hexdigest()[:32]


def _pack(shapes: Sequence[ShapeFile], files: Sequence[Path], category: str) -> MeshPack:
    meshes = []
    for shape, file in zip(shapes, files, strict=True):
        try:
            with np.load(file, allow_pickle=False) as arrays:
                parts = arrays["face_parts"] if "face_parts" in arrays.files else None
                meshes.append(Mesh(arrays["vertices"], arrays["faces"], shape.model_id, parts))
        except Exception as error:  # whatever a damaged archive makes numpy raise
            with contextlib.suppress(OSError):
                file.unlink()
            raise PackError(f"{file}: it is damaged and was removed; give the same command again.") from error
    return MeshPack.from_meshes(
        meshes, [shape.model_id for shape in shapes], [shape.split for shape in shapes], category
    )


def _file_name(category: str) -> str:
    return "".join(letter if letter.isalnum() or letter in "-_" else "_" for letter in category) or "shapes"
