"""Measurement of a visibility network on scans of known scanners: ranking, calibration and mean predictions."""

from __future__ import annotations

import dataclasses
import math
from dataclasses import dataclass

import numpy as np
import torch
from torch import Tensor

from kpred.errors import MeshError, PackError, ScanError
from kpred.nn.visibility import VisibilityNetwork, thinned
from kpred.ops.typing import Bool, Float
from kpred.shapes.pack import MeshPack
from kpred.training.data import POOL_POINTS
from kpred.training.dense_clouds import dense_cloud
from kpred.training.visibility_config import VisibilityTraining
from kpred.training.visibility_scans import KINDS, draw_visible, sample_scans

PLACES = 512
"""Places on each of the two surfaces of a scan."""

BINS = 10
"""Bins of predicted probability by which calibration is measured."""

SURE = 0.9
"""Mean visibility of seen surface, below which a scan counts as misread."""


@dataclass(frozen=True)
class VisibilityCase:
    """Scanners of one kind: its name in tables, its index in `KINDS`, and the fraction that a plane hides."""

    name: str
    kind: int
    hidden: float = 0.0


CASES = (
    VisibilityCase("whole", 0),
    *(VisibilityCase(f"sliced, {hidden:.0%} hidden", 1, hidden) for hidden in (0.25, 0.5, 0.75)),
    *(VisibilityCase(name, kind) for kind, name in enumerate(KINDS) if kind in (2, 3)),
)


@dataclass(frozen=True)
class VisibilityRow:
    """Numbers of one case; a number is NaN where there are no such places.

    Attributes:
        scans: number of scans.
        seen, hidden: mean probability on the own surface, where it is seen and where it is not.
        other_seen, other_hidden: on other shapes' surfaces.
        misread: fraction of scans whose mean probability on seen own surface is less than `SURE`.
        auc, other_auc: area under the ROC curve of the places on own surfaces, and on others'.
        calibration: mean absolute difference of probability and frequency over bins, weighted by places.
    """

    case: str
    scans: int
    seen: float
    hidden: float
    other_seen: float
    other_hidden: float
    misread: float
    auc: float
    other_auc: float
    calibration: float


def measure_visibility(
    network: VisibilityNetwork, pack: MeshPack, split: str, points: int, limit: int | None, seed: int
) -> list[VisibilityRow]:
    """Measure predictions for scans of `points` points, in the known unit box, of up to `limit` shapes of a split.

    Raises:
        PackError: if fewer than two shapes can be used.
    """
    generator = torch.Generator().manual_seed(seed)
    clouds = []
    for index in np.flatnonzero(pack.split == split)[:limit]:
        try:
            clouds.append(dense_cloud(pack[int(index)], POOL_POINTS + PLACES, generator))
        except (ScanError, MeshError):
            continue
    if len(clouds) < 2:
        raise PackError(f"The split {split} holds {len(clouds)} usable shapes; give a split of two or more.")
    return [_measure_case(network, clouds, case, points, generator) for case in CASES]


@torch.inference_mode()
def _measure_case(
    network: VisibilityNetwork, clouds: list[Tensor], case: VisibilityCase, points: int, generator: torch.Generator
) -> VisibilityRow:
    settings = VisibilityTraining(hidden=(case.hidden, case.hidden), noise=0.004, outliers=0.0, density=0.0)
    probabilities, labels = [], []
    for number, cloud in enumerate(clouds):
        other = clouds[(number + len(clouds) // 2) % len(clouds)]
        places = torch.cat([cloud[:PLACES], other[:PLACES]])[None]
        dense = cloud[None, PLACES:]
        visible = draw_visible(dense, dense, places, torch.tensor([case.kind]), settings, generator)
        scan = sample_scans(dense, visible.candidates, points, settings, generator)
        probabilities.append(torch.sigmoid(network(thinned(scan), places))[0])
        labels.append(visible.places[0])
    return summarize(case.name, torch.stack(probabilities), torch.stack(labels))


def summarize(
    case: str, probabilities: Float[Tensor, "scans places"], labels: Bool[Tensor, "scans places"]
) -> VisibilityRow:
    """Summarize predictions for places, the first half on own surfaces and the other half on other shapes'."""
    (own, other), (own_label, other_label) = probabilities.chunk(2, dim=1), labels.chunk(2, dim=1)
    per_scan = torch.where(own_label, own, torch.nan).nanmean(1)
    return VisibilityRow(
        case=case,
        scans=len(own),
        seen=float(own[own_label].mean()),
        hidden=float(own[~own_label].mean()),
        other_seen=float(other[other_label].mean()),
        other_hidden=float(other[~other_label].mean()),
        misread=float((per_scan < SURE).float().mean()),
        auc=area_under_curve(own.flatten(), own_label.flatten()),
        other_auc=area_under_curve(other.flatten(), other_label.flatten()),
        calibration=calibration_error(probabilities.flatten(), labels.flatten()),
    )


def area_under_curve(scores: Float[Tensor, " places"], labels: Bool[Tensor, " places"]) -> float:
    """Compute the probability that a positive place scores above a negative one, ties half; NaN without both."""
    positive, negative = int(labels.sum()), int((~labels).sum())
    if not positive or not negative:
        return float("nan")
    _, group, count = scores.unique(return_inverse=True, return_counts=True)
    last = count.double().cumsum(0)
    rank = (last - (count - 1) / 2)[group]  # from 1, equal scores in the mean
    return float((rank[labels].sum() - positive * (positive + 1) / 2) / (positive * negative))


def calibration_error(probabilities: Float[Tensor, " places"], labels: Bool[Tensor, " places"]) -> float:
    """Compute the expected calibration error (probability) over `BINS` equal bins."""
    bins = (probabilities * BINS).long().clamp(max=BINS - 1)
    difference = torch.zeros(BINS, dtype=torch.double)
    difference.index_add_(0, bins, probabilities.double() - labels.double())
    return float(difference.abs().sum() / len(labels))


def as_values(row: VisibilityRow) -> dict[str, str | int | float | None]:
    """Return a row as plain values, numbers rounded to four digits after the point, NaN as None."""
    values: dict[str, str | int | float | None] = {}
    for name, value in dataclasses.asdict(row).items():
        values[name] = (None if math.isnan(value) else round(value, 4)) if isinstance(value, float) else value
    return values
