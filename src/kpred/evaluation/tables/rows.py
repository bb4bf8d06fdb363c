"""Rows: what an evaluation says, one number a row with all that is needed to understand it."""

from __future__ import annotations

import json
import math
import os
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from kpred.atomic import atomic_path

UNIT = "unit box squared"
FRAME = "known unit box"

CD = "chamfer_distance"
UCD = "unilateral_chamfer_distance"
UCD_WHOLE = "unilateral_chamfer_distance_of_whole_surface"

UNDEFORMED = "undeformed_nearest"
RETRIEVED = "undeformed_retrieved"
NO_LEARNING = "no_learning"
WHOLE = "_whole"
"""Ending of metrics that are measured from the whole surface although only a part of it was seen."""


@dataclass(frozen=True)
class Score:
    """One number of one target.

    Attributes:
        protocol: `full` or `partial`; occlusion: share of the target's points that were hidden.
        metric: what was done, as `refined`; distance: what was measured of the result, as `chamfer_distance` or a
            measure of cleanliness (`kpred.evaluation.tables.cleanliness_scores`).
        top_k: how many models were deformed and compared; None where the whole database was.
        value: in `unit`.
    """

    protocol: str
    occlusion: float
    metric: str
    distance: str
    top_k: int | None
    value: float
    unit: str = UNIT


@dataclass(frozen=True)
class Row:
    """The mean of one metric over the targets of one pack, or of all packs together (dataset and category `all`).

    Attributes:
        dataset: folder of the pack's file; split, category: of the targets; database_models: models searched (mean
            over the targets where several packs are taken together, rounded).
        protocol, occlusion, top_k, metric, distance: see `Score`.
        value: mean over instances; percentile_95: of them; unit, frame: how to read it; n: number of instances.
        ratio_to_undeformed: value / value of the nearest undeformed model under the same distance.
        ratio_to_no_learning: value / value of the baseline without learning under the same distance and top_k.
    """

    dataset: str
    split: str
    category: str
    protocol: str
    occlusion: float
    top_k: int | None
    metric: str
    distance: str
    unit: str
    frame: str
    value: float
    percentile_95: float
    n: int
    database_models: int
    ratio_to_undeformed: float | None
    ratio_to_no_learning: float | None

    def to_json(self) -> dict[str, Any]:
        """Plain values; numbers that are not finite become None."""
        return {key: _plain(value) for key, value in asdict(self).items()}


def aggregate(scores: Iterable[Score], *, dataset: str, split: str, category: str, database_models: int) -> list[Row]:
    """One row for each (protocol, occlusion, metric, distance, top_k), in the order of their first score."""
    values: dict[tuple[str, float, str, str, int | None], list[float]] = {}
    units: dict[str, str] = {}
    for score in scores:
        units[score.distance] = score.unit
        key = (score.protocol, score.occlusion, score.metric, score.distance, score.top_k)
        values.setdefault(key, []).append(score.value)
    means = {key: math.fsum(found) / len(found) for key, found in values.items()}
    rows = []
    for key, found in values.items():
        protocol, occlusion, metric, distance, top_k = key
        ending = WHOLE if metric.endswith(WHOLE) else ""
        undeformed = means.get((protocol, occlusion, UNDEFORMED + ending, distance, None))
        no_learning = means.get((protocol, occlusion, NO_LEARNING + ending, distance, top_k))
        rows.append(
            Row(
                dataset=dataset,
                split=split,
                category=category,
                protocol=protocol,
                occlusion=occlusion,
                top_k=top_k,
                metric=metric,
                distance=distance,
                unit=units[distance],
                frame=FRAME,
                value=means[key],
                percentile_95=percentile_95(found),
                n=len(found),
                database_models=database_models,
                ratio_to_undeformed=_ratio(means[key], undeformed),
                ratio_to_no_learning=_ratio(means[key], no_learning),
            )
        )
    return rows


def percentile_95(values: Sequence[float]) -> float:
    """Compute the 95th percentile of at least one value; infinite or NaN where a value is not finite."""
    return float(np.percentile(values, 95)) if np.isfinite(values).all() else math.fsum(values)


def write_rows(path: str | os.PathLike[str], header: Mapping[str, Any], rows: Sequence[Row]) -> None:
    """Write `{"header": ..., "rows": [...]}` as JSON, whole or not at all.

    Raises:
        OutputError: if the file cannot be written there.
    """
    value = {"header": dict(header), "rows": [row.to_json() for row in rows]}
    with atomic_path(path) as temporary:
        temporary.write_text(json.dumps(value, indent=2, allow_nan=False) + "\n")


def _ratio(value: float, base: float | None) -> float | None:
    return None if base is None or not base > 0 else value / base


def _plain(value: Any) -> Any:
    return None if isinstance(value, float) and not math.isfinite(value) else value
