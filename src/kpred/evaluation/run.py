"""Evaluation of a model on mesh packs: targets of one split against a database, all methods in one run."""

from __future__ import annotations

import os
import warnings
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any, Literal

import torch

from kpred.database import Database
from kpred.errors import ConfigError, PackError
from kpred.evaluation.baselines import NoLearning
from kpred.evaluation.header import made_by, versions
from kpred.evaluation.protocols import FULL, PARTIAL, Bench, measure
from kpred.evaluation.rows import FRAME, UNIT, Row, Score, aggregate
from kpred.evaluation.searched import SOURCE_SPLIT, Progress, counter, searched
from kpred.evaluation.targets import read_targets
from kpred.fitting import RefineConfig
from kpred.nn import Model, load_model
from kpred.shapes import MeshPack

OCCLUSIONS = (0.0, 0.25, 0.5, 0.75)
ALL = "all"


def _warn(message: str) -> None:
    warnings.warn(message, stacklevel=3)


def evaluate(
    packs: Sequence[str | os.PathLike[str]],
    model: Model | str | os.PathLike[str] | None = None,
    database: Database | str | os.PathLike[str] | None = None,
    *,
    split: str = "val",
    top_k: int | Sequence[int] = 10,
    protocol: Literal["full", "partial", "all"] = "full",
    occlusions: Sequence[float] = OCCLUSIONS,
    limit: int | None = None,
    seed: int = 0,
    oracle: bool = False,
    refinement: RefineConfig | None = None,
    progress: Progress | None = None,
    report: Callable[[str], None] = _warn,
) -> list[Row]:
    """Measure a model against the nearest undeformed shapes and the baseline without learning.

    Every target is a cloud of 2048 points in the unit box of its whole mesh (known frame). The same arguments give the
    same rows. See `kpred.evaluation.protocols` for the metrics.

    Args:
        packs: files of mesh packs, or folders of them; the name of a file's folder is the name of its dataset.
        model: trained networks, or their name or folder; None means bundled.
        database: where to search; None builds one for every pack from its shapes in the split `source`.
        split: whose shapes are the targets.
        top_k: how many retrieved models are deformed and compared; several numbers are measured in one run.
        protocol: `full`, `partial` (at every one of `occlusions`, shares hidden by a random plane), or both.
        limit: at most so many targets a pack, drawn at random by seed.
        seed: of targets, planes and of the points of databases that are built.
        oracle: deform and compare all of the database as well (slow).
        refinement: settings of the refinement, for the model and for the baseline alike.
        progress: called as the work goes on.
        report: called with one sentence for each shape left out, and when targets are in the database.

    Returns:
        Rows of every pack, then of all packs together where there are several.

    Raises:
        PackError: a pack is missing, damaged, or has no shapes of a needed split.
        ModelError, DatabaseError: they are missing, do not fit each other, or do not know a pack's category.
        ConfigError: an argument has an impossible value.
    """
    steps = _steps(protocol, occlusions)
    plan = _Plan(_numbers(top_k), steps, split, limit, seed, oracle, refinement or RefineConfig())
    files = pack_files(packs)
    networks = model if isinstance(model, Model) else load_model(model)
    rows: list[Row] = []
    pooled: list[Score] = []
    models_searched: list[int] = []
    loaded = [MeshPack.load(file) for file in files]
    # What is wrong with the last pack must not come out after an hour's work on the first.
    for file, pack in zip(files, loaded, strict=True):
        _check(file, pack, networks, split, needs_source=database is None)
    for file, pack in zip(files, loaded, strict=True):
        scores, size, count = _measure_pack(file, pack, networks, database, plan, progress, report)
        dataset = file.resolve().parent.name
        rows += aggregate(scores, dataset=dataset, split=split, category=pack.category, database_models=size)
        pooled += scores
        models_searched += [size] * count
    if len(files) > 1:
        size = round(sum(models_searched) / len(models_searched))
        rows += aggregate(pooled, dataset=ALL, split=split, category=ALL, database_models=size)
    return rows


def pack_files(packs: Sequence[str | os.PathLike[str]]) -> list[Path]:
    """The files themselves, and the .npz files of folders in the order of their names.

    Raises:
        PackError: nothing was given, or a folder has no pack.
    """
    files: list[Path] = []
    for path in map(Path, packs):
        found = sorted(path.glob("*.npz")) if path.is_dir() else [path]
        if not found:
            raise PackError(f"{path}: the folder has no mesh packs; give .npz files, or a folder of them.")
        files += found
    if not files:
        raise PackError("There is no pack to evaluate on; give at least one .npz file.")
    return files


def run_header(
    model: Model,
    database: Database | str | os.PathLike[str] | None,
    *,
    split: str,
    top_k: int | Sequence[int],
    protocol: str,
    occlusions: Sequence[float] = OCCLUSIONS,
    limit: int | None = None,
    seed: int = 0,
    refinement: RefineConfig | None = None,
    remarks: Sequence[str] = (),
) -> dict[str, Any]:
    """What the rows of a run were made by, as plain values: model, database, seed, versions and how to read them."""
    path = database.path if isinstance(database, Database) else database
    return {
        **made_by(model),
        "database": f"built from the split '{SOURCE_SPLIT}' of each pack" if path is None else str(path),
        "split": split,
        "protocol": protocol,
        "occlusions": [] if protocol == FULL else list(occlusions),
        "top_k": list(_numbers(top_k)),
        "limit": limit,
        "seed": seed,
        "refinement": asdict(refinement or RefineConfig()),
        "unit": UNIT,
        "frame": FRAME,
        "remarks": list(remarks),
        "note": "mean over instances; the numbers of published tables are most likely 10^2 times these",
        "versions": versions(),
    }


@dataclass(frozen=True)
class _Plan:
    top_k: tuple[int, ...]
    steps: tuple[tuple[str, float], ...]
    split: str
    limit: int | None
    seed: int
    oracle: bool
    refinement: RefineConfig


def _measure_pack(
    file: Path,
    pack: MeshPack,
    model: Model,
    database: Database | str | os.PathLike[str] | None,
    plan: _Plan,
    progress: Progress | None,
    report: Callable[[str], None],
) -> tuple[list[Score], int, int]:
    """Scores of all targets of one pack, the number of models searched, and of targets."""
    name = f"{file.resolve().parent.name}/{pack.category}"
    network = model[pack.category]
    targets = read_targets(pack, str(file), plan.split, plan.limit, plan.seed, report)
    building = counter(progress, f"{name}: database", len(pack.indices(SOURCE_SPLIT)))
    with searched([file], model, database, plan.seed, building, report) as store:
        arrays = store.candidates(pack.category)
        known = set(arrays.model_ids) & {target.model_id for target in targets}
        if known:
            report(f"{file}: {len(known)} of {len(targets)} targets are in the database; their errors say little.")
        shapes = torch.from_numpy(arrays.points)
        baseline = NoLearning.build(
            arrays.model_ids, pack.category, shapes, counter(progress, f"{name}: baseline", len(shapes))
        )
        bench = Bench(network, store, baseline, plan.top_k, plan.refinement, plan.oracle)
        scores: list[Score] = []
        with torch.inference_mode():
            for done, target in enumerate(targets, start=1):
                for protocol, occlusion in plan.steps:
                    scores += measure(target, bench, protocol, occlusion)
                if progress is not None:
                    progress(f"{name}: {plan.split}", done, len(targets))
    return scores, len(shapes), len(targets)


def _check(file: Path, pack: MeshPack, model: Model, split: str, needs_source: bool) -> None:
    model[pack.category]
    if not len(pack.indices(split)):
        found = ", ".join(sorted(set(pack.split.tolist()))) or "none"
        raise PackError(f"{file}: no shape is in the split '{split}'; its splits are {found}.")
    if needs_source and not len(pack.indices(SOURCE_SPLIT)):
        raise PackError(f"{file}: no shape is in the split '{SOURCE_SPLIT}' to search; give a database.")


def _numbers(top_k: int | Sequence[int]) -> tuple[int, ...]:
    numbers = (top_k,) if isinstance(top_k, int) else tuple(top_k)
    if not numbers or min(numbers) < 1:
        raise ConfigError(f"top_k must be at least 1, but is {', '.join(map(str, numbers)) or 'empty'}.")
    return tuple(sorted(set(numbers)))


def _steps(protocol: str, occlusions: Sequence[float]) -> tuple[tuple[str, float], ...]:
    if protocol not in (FULL, PARTIAL, ALL):
        raise ConfigError(f"The protocol must be one of {FULL}, {PARTIAL}, {ALL}, but is '{protocol}'.")
    steps = [] if protocol == PARTIAL else [(FULL, 0.0)]
    if protocol != FULL:
        # Below some fifty points there is nothing to fit a shape to.
        if not occlusions or not all(0 <= share <= 0.95 for share in occlusions):
            raise ConfigError(f"Occlusions must be shares from 0 to 0.95, but are {list(occlusions)}.")
        steps += [(PARTIAL, float(share)) for share in occlusions]
    return tuple(steps)
