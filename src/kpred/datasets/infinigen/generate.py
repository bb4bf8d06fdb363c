"""Packs of Infinigen's furniture: factories and seeds are drawn here, shapes are made by workers in its own Python.

Infinigen (PyPI `infinigen`, code BSD-3-Clause) wants other versions of numpy and trimesh than this package and brings
Blender with it, so that it lives in an environment of its own; `kpred.datasets.infinigen.worker` runs there.
"""

from __future__ import annotations

import contextlib
import random
import subprocess
import sys
import threading
import zipfile
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from kpred.datasets.check import Issue
from kpred.datasets.infinigen.factories import FACTORIES
from kpred.datasets.infinigen.worker import MISSING
from kpred.errors import ConfigError, MeshError, OutputError
from kpred.shapes.mesh import Mesh, clean_mesh
from kpred.shapes.pack import MeshPack

FRACTIONS = {"source": 0.15, "train": 0.70, "val": 0.15}

WORKER = Path(__file__).with_name("worker.py")

JOBS = 25
"""Shapes that one process makes before another takes over: Blender does not give all memory back."""

Progress = Callable[[str, int, int], None]
"""Called with (what is being done, done, total)."""


@dataclass(frozen=True)
class GenerationReport:
    """A pack of furniture; `failed`: what a factory could not make; `made`, `kept`: shapes made now and before."""

    pack: MeshPack
    failed: tuple[Issue, ...]
    made: int
    kept: int


def generate_infinigen(
    category: str,
    count: int,
    folder: Path,
    seed: int = 0,
    python: str | Path = sys.executable,
    workers: int = 1,
    max_faces: int = 3000,
    progress: Progress | None = None,
) -> GenerationReport:
    """Generate `count` shapes of a category, keeping those in `folder`; resumable.

    Which factory and seed shape i has depends on category, seed and i alone; what Infinigen makes of them is its own.

    Args:
        folder: where single shapes are kept.
        python: interpreter of the environment that has infinigen.
        workers: processes, each with a Blender of its own.
        max_faces: triangles that a shape is reduced to.

    Raises:
        ConfigError: an unknown category, a number below 1, or a Python without infinigen.
        MeshError: nothing could be made.
        OutputError: the folder cannot be made.
    """
    if category not in FACTORIES:
        raise ConfigError(f"Infinigen has no factories for '{category}'; choose one of {', '.join(FACTORIES)}.")
    if min(count, workers) < 1 or max_faces < 12:
        raise ConfigError("Infinigen needs a count and workers of at least 1, and at least 12 triangles a shape.")
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise OutputError(f"Cannot make the folder {folder}: {error.strerror}; choose another.") from error
    drawn = [_assign(category, seed, i) for i in range(count)]
    missing = [item for item in drawn if not _file(folder, item).is_file()]
    failed: dict[str, str] = {}
    lock = threading.Lock()

    def report_line(line: str) -> None:
        word, _, rest = line.partition(" ")
        with lock:
            if word == "failed":
                name, _, why = rest.partition(" ")
                failed[name] = why
            if progress is not None:
                there = sum(_file(folder, item).is_file() for item in drawn)
                progress("making furniture", there + len(failed), count)

    batches = [missing[start : start + JOBS] for start in range(0, len(missing), JOBS)]
    _run(batches, folder, str(python), workers, max_faces, report_line)
    meshes, names, used = [], [], []
    for item in drawn:
        name = f"{item[0]}_{item[1]}"
        try:
            meshes.append(_read(_file(folder, item), name))
        except MeshError as error:
            failed.setdefault(name, str(error))
            continue
        names.append(name)
        used.append(item)
    issues = tuple(Issue("shape", name, why) for name, why in sorted(failed.items()))
    if not meshes:
        why = f"the first: {issues[0].why}" if issues else "the process died"
        raise MeshError(f"Infinigen made none of {count} shapes ({why}); run it with --debug in its own environment.")
    extra = {
        "factory": np.array([item[0] for item in used], dtype=str),
        "seed": np.array([str(item[1]) for item in used], dtype=str),
    }
    pack = MeshPack.from_meshes(meshes, names, [_split(name) for name in names], category, extra=extra)
    kept = sum(item not in missing for item in used)
    return GenerationReport(pack, issues, len(used) - kept, kept)


def _assign(category: str, seed: int, index: int) -> tuple[str, int]:
    """Return factory and seed of one shape."""
    factories = FACTORIES[category]
    chance = random.Random(f"{category} {seed} {index}")
    factory = chance.choices(list(factories), list(factories.values()))[0]
    # Infinigen's own seeds are of 31 bits.
    return factory, chance.randrange(2**31 - 1)


def _split(name: str) -> str:
    value = random.Random(name).random()
    for split, fraction in FRACTIONS.items():
        value -= fraction
        if value < 0:
            return split
    return "val"


def _file(folder: Path, item: tuple[str, int]) -> Path:
    return folder / f"{item[0]}_{item[1]}.npz"


def _read(file: Path, name: str) -> Mesh:
    try:
        with np.load(file, allow_pickle=False) as arrays:
            return clean_mesh(Mesh(arrays["vertices"], arrays["faces"], name))
    except FileNotFoundError as error:
        raise MeshError(f"{name}: it was not made") from error
    except (OSError, ValueError, LookupError, EOFError, zipfile.BadZipFile) as error:
        with contextlib.suppress(OSError):
            file.unlink()
        raise MeshError(f"{file}: it is damaged and was removed; give the same command again.") from error


def _run(
    batches: Sequence[Sequence[tuple[str, int]]],
    folder: Path,
    python: str,
    workers: int,
    max_faces: int,
    report_line: Callable[[str], None],
) -> None:
    """Run the worker on all batches, so many at a time."""
    waiting = list(reversed(batches))
    running: list[subprocess.Popen[str]] = []
    trouble: list[ConfigError] = []
    lock = threading.Lock()

    def work() -> None:
        while True:
            with lock:
                if not waiting or trouble:
                    return
                jobs = [f"{factory}:{seed}" for factory, seed in waiting.pop()]
                try:
                    process = subprocess.Popen(
                        [python, str(WORKER), str(folder), str(max_faces), *jobs],
                        stdin=subprocess.DEVNULL,
                        stdout=subprocess.PIPE,
                        stderr=subprocess.DEVNULL,
                        text=True,
                    )
                except OSError as error:
                    trouble.append(
                        ConfigError(f"{python} cannot be run ({error.strerror}); name a Python by --python.")
                    )
                    return
                running.append(process)
            assert process.stdout is not None
            for line in process.stdout:
                report_line(line.strip())
            if process.wait() == MISSING:
                with lock:
                    trouble.append(
                        ConfigError(
                            f"{python} has no infinigen; make an environment for it (docs/datasets.md) and name its "
                            "Python by --python."
                        )
                    )

    threads = [threading.Thread(target=work, daemon=True) for _ in range(min(workers, max(1, len(batches))))]
    try:
        for thread in threads:
            thread.start()
        for thread in threads:
            thread.join()
    except BaseException:
        with lock:
            waiting.clear()
        for process in running:
            process.kill()
        raise
    if trouble:
        raise trouble[0]
