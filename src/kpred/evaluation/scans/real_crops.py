"""Crops of real scans, one object each, fitted with nothing given but the up axis, or with nothing given at all.

There is no true shape to compare with: what is measured is how near the crop's points lie to the result, whether it is
of the right category, and how clean the result is. Distances are means over points, to the result's surface, in metres:
`all points` of the crop as it is, which holds points of floor and neighbours, and `kept points`, those that cleaning
takes for the object's.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import trimesh

from kpred.errors import ConfigError, ScanError
from kpred.evaluation.database_source import Progress
from kpred.evaluation.metrics.cleanliness_measures import MEASURES
from kpred.evaluation.metrics.summary import Scope, Summary
from kpred.evaluation.metrics.surfaces import Surface
from kpred.evaluation.scans.outcome import (
    FailedFit,
    FitOutcome,
    FitSettings,
    by_category,
    claims,
    known_values,
    try_fit,
)
from kpred.fitting import Fit
from kpred.ops.rotations import UP_AXES, upright_rotation
from kpred.preprocessing.clean import clean_scan
from kpred.rendering.contact_sheet import Tile, Verdict
from kpred.scenes.scan2cad import read_json
from kpred.shapes import read_scan
from kpred.shapes.categories import category_of
from kpred.shapes.structure.cleanliness import Cleanliness

NEAR_METRES = 0.04
INDEX = "index.json"
SPLIT = "real"


@dataclass(frozen=True)
class Crop:
    """A file with one object, in metres.

    Attributes:
        file: the point cloud; category: what it shows; up: its up axis.
    """

    file: Path
    category: str
    up: str


@dataclass(frozen=True, eq=False, kw_only=True)
class CropOutcome(FitOutcome):
    """What became of one crop.

    Attributes:
        file: of the crop; points: how many it has; kept: how many cleaning keeps as the object's.
        distance_all, distance_kept: mean distance to the result, metres.
        up_right: whether the up axis was found, if it was not given.
        step: how far the model was changed; cleanliness: what its mesh lost by that.
        tile: picture of it.
    """

    file: str
    tile: Tile
    points: int = 0
    kept: int = 0
    distance_all: float | None = None
    distance_kept: float | None = None
    up_right: bool | None = None
    step: str | None = None
    cleanliness: Cleanliness | None = None

    @property
    def near(self) -> bool:
        """Whether the kept points lie within 4 cm of the result on average."""
        return self.distance_kept is not None and self.distance_kept < NEAR_METRES

    @property
    def all_near(self) -> bool:
        """Whether all points do."""
        return self.distance_all is not None and self.distance_all < NEAR_METRES

    def facts(self) -> dict[str, Any]:
        """See `FitOutcome`."""
        return {"cleanliness": None if self.cleanliness is None else self.cleanliness.to_json()}


def read_crops(folder: str | os.PathLike[str], up: str | None = None) -> list[Crop]:
    """List the crops of a folder: `<category>_<nn>.ply`, or what its `index.json` lists.

    The index is a list of objects with `file`, `category` and `up`; without it names give the category, and up is y.

    Args:
        up: up axis of all crops; None takes what the index says.

    Raises:
        ScanError: there is no such folder, it has no .ply files, or its index is no such list.
        ConfigError: an up axis is none of x, y, z, -x, -y, -z.
    """
    root = Path(folder)
    files = sorted(root.glob("*.ply"))
    if not files:
        raise ScanError(f"{root}: there is no such folder with .ply files; give a folder of <category>_<nn>.ply.")
    entries: dict[str, dict[str, Any]] = {}
    if (root / INDEX).is_file():
        content = read_json(root / INDEX)
        if not isinstance(content, list) or not all(isinstance(item, dict) and "file" in item for item in content):
            raise ScanError(f"{root / INDEX}: it is no list of crops with file, category and up; mend or remove it.")
        entries = {str(item["file"]): item for item in content}
    crops = []
    for file in files:
        entry = entries.get(file.name, {})
        category = entry.get("category") or file.stem.rpartition("_")[0] or file.stem
        axis = up or str(entry.get("up", "y"))
        if axis not in UP_AXES:
            raise ConfigError(f"{file}: the up axis must be one of {', '.join(UP_AXES)}, but is '{axis}'.")
        crops.append(Crop(file, category_of(str(category)), axis))
    return crops


def measure_crop(crop: Crop, settings: FitSettings, find_up: bool = False) -> CropOutcome:
    """Fit a crop and measure the result, in metres and degrees; errors of reading and fitting go to the outcome.

    Args:
        find_up: whether the fit must find the up axis.
    """
    name = crop.file.name
    try:
        points = read_scan(crop.file, seed=settings.seed).astype(np.float64)
    except ScanError as error:
        nothing = Tile((name, str(error)), "wrong", np.zeros((1, 3)))
        return CropOutcome(file=name, category=crop.category, tile=nothing, failure=str(error))
    found = try_fit(points, settings, up="auto" if find_up else crop.up)
    if isinstance(found, FailedFit):
        standing = points @ upright_rotation(crop.up).T
        nothing = Tile((name, found.reason), "wrong", standing)
        return CropOutcome(file=name, category=crop.category, tile=nothing, points=len(points), failure=found.reason)
    kept = clean_scan(points, crop.up, seed=settings.seed).object_points
    distances = Surface(found.mesh).distances(points)
    unit = found.frame.to_unit(np.asarray(found.mesh.vertices, dtype=np.float64))
    picture = Tile((), "open", found.frame.to_unit(points), trimesh.Trimesh(unit, found.mesh.faces, process=False))
    outcome = CropOutcome(
        file=name,
        category=crop.category,
        tile=picture,
        points=len(points),
        kept=int(kept.sum()),
        distance_all=float(distances.mean()),
        distance_kept=float(distances[kept].mean()),
        up_right=_up_right(found, crop) if find_up else None,
        step=found.source.step,
        cleanliness=found.cleanliness,
        **claims(found),
    )
    verdict: Verdict = "right" if outcome.near and outcome.category_right else "wrong"
    return replace(outcome, tile=replace(picture, lines=_labels(outcome), verdict=verdict))


def evaluate_crops(
    crops: Sequence[Crop],
    settings: FitSettings,
    *,
    find_up: bool = False,
    progress: Progress | None = None,
    report: Callable[[str], None] | None = None,
) -> list[CropOutcome]:
    """Outcomes of all crops of categories that the model and the database know, in order; others go to `report`.

    Raises:
        ScanError: there is no crop of a known category.
    """
    known = set(settings.model.categories) & set(settings.database.categories())
    outcomes = []
    for done, crop in enumerate(crops, start=1):
        if crop.category in known:
            outcomes.append(measure_crop(crop, settings, find_up))
        elif report is not None:
            report(f"left out: {crop.file}: {crop.category} is not among the categories of model and database.")
        if progress is not None:
            progress("crops", done, len(crops))
    if not outcomes:
        raise ScanError(f"No crop is of a known category ({', '.join(sorted(known))}); name files <category>_<nn>.ply.")
    return outcomes


def summarise_crops(outcomes: Sequence[CropOutcome], dataset: str, seed: int) -> list[Summary]:
    """Summaries of each category and of all crops; a crop without a result counts as wrong, and not in means."""
    rows: list[Summary] = []
    for category, mine in by_category(outcomes):
        fitted = [outcome for outcome in mine if outcome.failure is None]
        scope, frame = Scope(dataset, SPLIT, category, seed), "scan"
        for name in ("distance_all", "distance_kept"):
            rows += scope.mean(name, [getattr(outcome, name) for outcome in fitted], "m", frame)
        rows += scope.fraction("all_points_under_4_cm", [outcome.all_near for outcome in mine], frame)
        rows += scope.fraction("kept_points_under_4_cm", [outcome.near for outcome in mine], frame)
        rows += scope.fraction("category_right", [outcome.category_right for outcome in mine], frame)
        rows += scope.fraction("up_axis_right", [one.up_right for one in fitted if one.up_right is not None], frame)
        rows += _of_cleanliness([one.cleanliness for one in fitted if one.cleanliness is not None], scope)
        rows += scope.fraction("warned", [outcome.warnings > 0 for outcome in mine], frame)
        rows += scope.mean("confidence", known_values(mine, "confidence"), "1", frame)
        rows += scope.fraction("failed", [outcome.failure is not None for outcome in mine], frame)
        rows += scope.median("milliseconds", known_values(fitted, "milliseconds"), "ms", frame)
    return rows


def _of_cleanliness(found: Sequence[Cleanliness], scope: Scope) -> list[Summary]:
    """Means and 95th percentiles over the crops."""
    rows: list[Summary] = []
    for name, unit in MEASURES.items():
        values = [float(value) for one in found if (value := one.to_json()[name]) is not None]
        rows += scope.mean(name, values, unit, "unit box of the result")
        rows += scope.percentile_95(name, values, unit, "unit box of the result")
    return rows


def _up_right(found: Fit, crop: Crop) -> bool:
    """Compare the axis that the fit takes for up with the crop's."""
    return bool((found.frame.rotation @ np.array(UP_AXES[crop.up], dtype=np.float64))[1] > 0.9)


def _labels(outcome: CropOutcome) -> tuple[str, ...]:
    confidence = "" if outcome.confidence is None else f", confidence {outcome.confidence:.2f}"
    return (
        f"{outcome.file}: {outcome.found}{confidence}",
        f"{100 * (outcome.distance_kept or 0):.1f} cm kept points, {100 * (outcome.distance_all or 0):.1f} cm all",
    )
