"""Evaluation of a model on mesh packs: targets of one split against a database, all methods in one run."""

from __future__ import annotations

import os
import warnings
from collections.abc import Callable, Sequence
from dataclasses import asdict
from typing import Any, Literal

from kpred.database import Database
from kpred.evaluation.header import made_by, versions
from kpred.evaluation.searched import SOURCE_SPLIT, Progress
from kpred.evaluation.tables.measuring import Plan, checked_packs, measure_pack, numbers, pack_files, steps_of
from kpred.evaluation.tables.protocols import FULL
from kpred.evaluation.tables.rows import FRAME, UNIT, Row, Score, aggregate
from kpred.evaluation.tables.table import ALL
from kpred.fitting import RefineConfig
from kpred.nn import Model, load_model
from kpred.refinement.structure_config import StructureConfig

OCCLUSIONS = (0.0, 0.25, 0.5, 0.75)
MODEL = "model"


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
    structure: StructureConfig | None = None,
    progress: Progress | None = None,
    report: Callable[[str], None] = _warn,
) -> list[Row]:
    """Measure a model against the nearest undeformed shapes and the baseline without learning.

    Every target is a cloud of 2048 points in the unit box of its whole mesh (known frame). The same arguments give the
    same rows. See `kpred.evaluation.tables.protocols` for the metrics.

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
        refinement: settings of the keypoints' refinement, for the model and for the baseline alike; structure: of the
            structure-keeping deformation.
        progress: called as the work goes on.
        report: called with one sentence for each shape left out, and when targets are in the database.

    Returns:
        Rows of every pack, then of all packs together where there are several.

    Raises:
        PackError: a pack is missing, damaged, or has no shapes of a needed split.
        ModelError, DatabaseError: they are missing, do not fit each other, or do not know a pack's category.
        ConfigError: an argument has an impossible value.
    """
    plan = Plan(
        numbers(top_k),
        steps_of(protocol, occlusions),
        split,
        limit,
        seed,
        oracle,
        refinement or RefineConfig(),
        structure=structure or StructureConfig(),
    )
    files = pack_files(packs)
    networks = model if isinstance(model, Model) else load_model(model)
    rows: list[Row] = []
    pooled: list[Score] = []
    models_searched: list[int] = []
    for pack in checked_packs(files, [networks], split, needs_source=database is None):
        measured = measure_pack(pack, {MODEL: networks}, {MODEL: database}, plan, progress, report)
        scores = [score for target in measured for _, score in target.scores]
        size = measured[0].database_models
        rows += aggregate(scores, dataset=pack.dataset, split=split, category=pack.pack.category, database_models=size)
        pooled += scores
        models_searched += [size] * len(measured)
    if len(files) > 1:
        size = round(sum(models_searched) / len(models_searched))
        rows += aggregate(pooled, dataset=ALL, split=split, category=ALL, database_models=size)
    return rows


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
    structure: StructureConfig | None = None,
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
        "top_k": list(numbers(top_k)),
        "limit": limit,
        "seed": seed,
        "refinement": asdict(refinement or RefineConfig()),
        "structure": asdict(structure or StructureConfig()),
        "unit": UNIT,
        "frame": FRAME,
        "remarks": list(remarks),
        "note": "mean over instances; the numbers of published tables are most likely 10^2 times these",
        "versions": versions(),
    }
