"""What a fit makes of one virtual scan: with nothing given but gravity (unknown), and with all given (known).

Errors are measured from the true surface to the result, in the true unit box of the whole object, also where the fit
found another box.
"""

from __future__ import annotations

from dataclasses import asdict, dataclass
from typing import Any

import numpy as np
import trimesh

from kpred.database import Database
from kpred.errors import KpredError
from kpred.evaluation.metrics.summary import finite
from kpred.evaluation.metrics.surfaces import Surface
from kpred.evaluation.metrics.symmetry import yaw_between, yaw_error
from kpred.evaluation.scans.targets import ScanTarget
from kpred.fitting import Fit
from kpred.fitting.pipeline import fit
from kpred.nn import Model
from kpred.ops import Frame
from kpred.ops.rotations import upright_rotation
from kpred.pose.proposals import up_axis

YAW_RIGHT = 15.0
"""Degrees."""

NEAR = 0.1
"""Mean distance, unit box, from the whole surface to a result that is right: 5 % of the longest side."""


@dataclass(frozen=True)
class Errors:
    """Of one result, in the true unit box (longest side 2).

    Attributes:
        whole, visible: mean squared distance (UCD) from the whole surface, and from what the camera saw without noise,
            to the result; unit box squared.
        distance: mean distance from the whole surface to the result, unit box.
        centre: from the middle of the true box to that of the result's box in the true axes; size: mean difference of
            the three sides; both as shares of the true longest side.
    """

    whole: float
    visible: float
    distance: float
    centre: float
    size: float


@dataclass(frozen=True, eq=False)
class ScanOutcome:
    """What became of one target.

    Attributes:
        model_id, category: of the true shape; symmetry: name of its symmetry.
        failure: why the unknown fit gave no result; known_failure: why the known one did not.
        found: category of the result; model: id of its model.
        confidence: of the result, None where it was not judged; warnings: number of its warnings.
        yaw: error in degrees up to symmetry; milliseconds: that the fit took.
        up: the axis that is found to point up if the scan lies with z up and nobody says so.
        unknown, known: errors of the results, None where there is none.
        result: mesh of the unknown fit in the true unit box, where it was asked for.
    """

    model_id: str
    category: str
    symmetry: str
    failure: str | None = None
    known_failure: str | None = None
    found: str | None = None
    model: str | None = None
    confidence: float | None = None
    warnings: int = 0
    yaw: float | None = None
    milliseconds: float | None = None
    up: str | None = None
    unknown: Errors | None = None
    known: Errors | None = None
    result: trimesh.Trimesh | None = None

    @property
    def category_right(self) -> bool:
        """Whether the result is of the true category."""
        return self.found == self.category

    @property
    def up_right(self) -> bool:
        """Whether the up axis is found."""
        return self.up == "z"

    @property
    def yaw_right(self) -> bool:
        """Whether the yaw is right within 15 degrees, up to symmetry."""
        return self.yaw is not None and self.yaw <= YAW_RIGHT

    @property
    def right(self) -> bool:
        """Whether category and yaw are right and the whole surface is near the result."""
        near = self.unknown is not None and self.unknown.distance < NEAR
        return self.category_right and self.yaw_right and near

    def to_json(self) -> dict[str, Any]:
        """Plain values, without the mesh."""
        facts = {key: value for key, value in self.__dict__.items() if key != "result"}
        errors = {key: asdict(value) for key, value in facts.items() if isinstance(value, Errors)}
        return finite({**facts, "right": self.right, **errors})


@dataclass(frozen=True, eq=False)
class Fitting:
    """How scans are fitted: the networks, the database, how many candidates are compared, the seed of sampling."""

    model: Model
    database: Database
    top_k: int
    seed: int


def measure_scan(target: ScanTarget, category: str, how: Fitting, keep_mesh: bool = False) -> ScanOutcome:
    """Fit a target twice and measure both results; what a fit raises is told in the outcome, never raised."""
    found = tried(target.scan, how, up="y")
    truth: dict[str, Any] = {"model_id": target.model_id, "category": category, "symmetry": target.symmetry.name}
    # The rotation takes z up to y up; from the right it takes y up to z up.
    truth["up"] = up_axis(target.scan @ upright_rotation("z"), "auto", how.model.recognizer)
    given = tried(target.known, how, frame="known", category=category, partial=True)
    known, known_failure = (None, given) if isinstance(given, str) else (errors_of_result(given.mesh, target), None)
    if isinstance(found, str):
        return ScanOutcome(**truth, failure=found, known_failure=known_failure, known=known)
    mesh = moved(found.mesh, target.frame)
    return ScanOutcome(
        **truth,
        known_failure=known_failure,
        known=known,
        unknown=errors_of_result(mesh, target),
        yaw=yaw_error(yaw_between(found.frame.rotation, target.frame.rotation), target.symmetry),
        result=mesh if keep_mesh else None,
        **claimed(found),
    )


def measure_other(target: ScanTarget, category: str, how: Fitting, keep_mesh: bool = False) -> ScanOutcome:
    """Fit a scan of something that is of no known category: only what the fit claims is of interest."""
    found = tried(target.scan, how, up="y")
    if isinstance(found, str):
        return ScanOutcome(target.model_id, category, target.symmetry.name, failure=found)
    mesh = moved(found.mesh, target.frame) if keep_mesh else None
    return ScanOutcome(target.model_id, category, target.symmetry.name, result=mesh, **claimed(found))


def tried(points: np.ndarray, how: Fitting, **options: Any) -> Fit | str:
    """A fit, or one sentence that says why there is none."""
    try:
        return fit(points, how.model, how.database, top_k=how.top_k, seed=how.seed, **options)
    except KpredError as error:
        return " ".join(str(error).split())
    except Exception as error:  # One target must not cost the others their results.
        return f"unexpected {type(error).__name__}: {' '.join(str(error).split())}"


def claimed(found: Fit) -> dict[str, Any]:
    """What a fit says about itself, by the names of `ScanOutcome`'s attributes."""
    return {
        "found": found.category,
        "model": found.source.model_id,
        "confidence": float(found.confidence),
        "warnings": len(found.warnings),
        "milliseconds": 1000 * sum(found.timings.values()),
    }


def moved(mesh: trimesh.Trimesh, frame: Frame) -> trimesh.Trimesh:
    """A mesh in the scan's frame, taken into the unit box."""
    vertices = frame.to_unit(np.asarray(mesh.vertices, dtype=np.float64))
    return trimesh.Trimesh(vertices, np.asarray(mesh.faces), process=False)


def errors_of_result(mesh: trimesh.Trimesh, target: ScanTarget) -> Errors:
    """Measure a result in the true unit box against the true surface and box."""
    surface = Surface(mesh)
    whole, visible = surface.distances(target.whole), surface.distances(target.visible)
    corners = np.asarray(mesh.vertices, dtype=np.float64)[np.unique(np.asarray(mesh.faces))]
    low, high = corners.min(axis=0), corners.max(axis=0)
    side = float((target.high - target.low).max())
    return Errors(
        whole=float(np.square(whole).mean()),
        visible=float(np.square(visible).mean()),
        distance=float(whole.mean()),
        centre=float(np.linalg.norm((low + high - target.low - target.high) / 2)) / side,
        size=float(np.abs((high - low) - (target.high - target.low)).mean()) / side,
    )
