"""Measure how well a visibility network knows what scanners would have seen, on shapes of mesh packs.

    python scripts/measure_visibility.py PACK.npz [...] [--weights FOLDER] [--split val] [--limit N] [-o rows.json]

Scans of each shape are whole, cut by planes, one depth view, and merged views, in the known unit box. The table shows
mean probabilities on surfaces that are seen and hidden, the fraction of misread scans, the areas under the ROC curves
and the calibration error.
"""

from __future__ import annotations

import argparse
import json
import math
from dataclasses import asdict, dataclass
from pathlib import Path

import numpy as np
import torch
from torch import Tensor

from kpred.errors import MeshError, PackError, ScanError
from kpred.evaluation.metrics.reliability import area_under_roc, reliability
from kpred.nn import load_visibility
from kpred.nn.loading import VISIBILITY, bundled_model_path
from kpred.nn.visibility import VisibilityNetwork, thinned
from kpred.ops.typing import Bool, Float
from kpred.shapes.pack import MeshPack
from kpred.training.data import POOL_POINTS
from kpred.training.dense_clouds import dense_cloud
from kpred.training.visibility_config import VisibilityTraining
from kpred.training.visibility_scans import KINDS, draw_visible, sample_scans

PLACES = 512
"""Places on each of the two surfaces of a scan."""

SURE = 0.9
"""Mean visibility of seen surface, below which a scan counts as misread."""

COLUMNS = {
    "seen": "seen",
    "hidden": "hidden",
    "other_seen": "seen, other",
    "other_hidden": "hidden, other",
    "misread": "misread",
    "auc": "AUC",
    "other_auc": "AUC, other",
    "calibration": "ECE",
}


@dataclass(frozen=True)
class Case:
    """Scanners of one kind: its name in tables, its index in `KINDS`, and the fraction that a plane hides."""

    name: str
    kind: int
    hidden: float = 0.0


CASES = (
    Case("whole", 0),
    *(Case(f"sliced, {hidden:.0%} hidden", 1, hidden) for hidden in (0.25, 0.5, 0.75)),
    *(Case(name, kind) for kind, name in enumerate(KINDS) if kind in (2, 3)),
)


@dataclass(frozen=True)
class Row:
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
) -> list[Row]:
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
    network: VisibilityNetwork, clouds: list[Tensor], case: Case, points: int, generator: torch.Generator
) -> Row:
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


def summarize(case: str, probabilities: Float[Tensor, "scans places"], labels: Bool[Tensor, "scans places"]) -> Row:
    """Summarize predictions for places, the first half on own surfaces and the other half on other shapes'."""
    (own, other), (own_label, other_label) = probabilities.chunk(2, dim=1), labels.chunk(2, dim=1)
    per_scan = torch.where(own_label, own, torch.nan).nanmean(1)
    return Row(
        case=case,
        scans=len(own),
        seen=float(own[own_label].mean()),
        hidden=float(own[~own_label].mean()),
        other_seen=float(other[other_label].mean()),
        other_hidden=float(other[~other_label].mean()),
        misread=float((per_scan < SURE).float().mean()),
        auc=_area(own, own_label),
        other_auc=_area(other, other_label),
        calibration=reliability(probabilities.flatten().tolist(), labels.flatten().tolist()).ece,
    )


def _area(scores: Float[Tensor, "scans places"], labels: Bool[Tensor, "scans places"]) -> float:
    found = area_under_roc(scores.flatten().numpy(), labels.flatten().numpy())
    return math.nan if found is None else found


def plain_values(row: Row) -> dict[str, str | int | float | None]:
    """Return a row as plain values, numbers rounded to four digits after the point, NaN as None."""
    values: dict[str, str | int | float | None] = asdict(row)
    return {
        name: (None if math.isnan(value) else round(value, 4)) if isinstance(value, float) else value
        for name, value in values.items()
    }


def main() -> None:
    """Measure every pack and print a Markdown table; write the rows if a file is named."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("packs", type=Path, nargs="+")
    parser.add_argument("--weights", type=Path, default=bundled_model_path() / VISIBILITY)
    parser.add_argument("--split", default="val")
    parser.add_argument("--limit", type=int, help="shapes of each pack")
    parser.add_argument("--points", type=int, default=2048, help="points of a scan")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("-o", "--output", type=Path)
    options = parser.parse_args()
    torch.set_num_threads(1)
    network = load_visibility(options.weights)
    found = []
    print(f"| pack | scans | {' | '.join(COLUMNS.values())} |")
    print(f"|---|---|{'---|' * len(COLUMNS)}")
    for path in options.packs:
        pack = MeshPack.load(path)
        dataset = f"{path.resolve().parent.name} {pack.category}"
        for row in measure_visibility(network, pack, options.split, options.points, options.limit, options.seed):
            values = plain_values(row)
            found.append({"pack": dataset, "split": options.split, "points": options.points, **values})
            numbers = " | ".join("" if values[name] is None else f"{values[name]:.3f}" for name in COLUMNS)
            print(f"| {dataset} | {row.case} | {numbers} |")
    if options.output is not None:
        options.output.write_text(json.dumps(found, indent=2) + "\n")


if __name__ == "__main__":
    main()
