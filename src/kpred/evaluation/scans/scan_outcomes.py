"""What a fit makes of one virtual scan: with nothing given but gravity (unknown), and with all given (known).

Errors are measured from the true surface to the result, in the true unit box of the whole object, also where the fit
found another box.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import trimesh

from kpred.evaluation.metrics.surfaces import Surface
from kpred.evaluation.metrics.symmetry import yaw_between, yaw_error
from kpred.evaluation.scans.outcome import YAW_RIGHT, FailedFit, FitOutcome, FitSettings, claims, moved, try_fit
from kpred.evaluation.scans.targets import ScanTarget
from kpred.fitting.stages import Context
from kpred.ops.rotations import upright_rotation
from kpred.pose.proposals import up_axis

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
            the three sides; both as fractions of the true longest side.
    """

    whole: float
    visible: float
    distance: float
    centre: float
    size: float


@dataclass(frozen=True, eq=False, kw_only=True)
class ScanOutcome(FitOutcome):
    """What became of one target.

    Attributes:
        model_id: of the true shape; symmetry: name of its symmetry.
        known_failure: why the known fit gave no result.
        yaw: error in degrees up to symmetry.
        up: the axis that is found to point up if the scan lies with z up and its up axis is not given.
        unknown, known: errors of the results, None where there is none.
        result: mesh of the unknown fit in the true unit box, if it is wanted.
    """

    model_id: str
    symmetry: str
    known_failure: str | None = None
    yaw: float | None = None
    up: str | None = None
    unknown: Errors | None = None
    known: Errors | None = None
    result: trimesh.Trimesh | None = None

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

    def facts(self) -> dict[str, Any]:
        """See `FitOutcome`."""
        return {"right": self.right}


def measure_scan(target: ScanTarget, category: str, settings: FitSettings, keep_mesh: bool = False) -> ScanOutcome:
    """Fit a target twice and measure both results; errors of fits go to the outcome."""
    found = try_fit(target.scan, settings, up="y")
    truth: dict[str, Any] = {"model_id": target.model_id, "category": category, "symmetry": target.symmetry.name}
    # The rotation takes z up to y up; from the right it takes y up to z up.
    recognizer = Context.load(settings.model, settings.database, None).recognizer
    truth["up"] = up_axis(target.scan @ upright_rotation("z"), "auto", recognizer)
    given = try_fit(target.known, settings, frame="known", category=category, partial=True)
    known = None if isinstance(given, FailedFit) else errors_of_result(given.mesh, target)
    known_failure = given.reason if isinstance(given, FailedFit) else None
    if isinstance(found, FailedFit):
        return ScanOutcome(**truth, failure=found.reason, known_failure=known_failure, known=known)
    mesh = moved(found.mesh, target.frame)
    return ScanOutcome(
        **truth,
        known_failure=known_failure,
        known=known,
        unknown=errors_of_result(mesh, target),
        yaw=yaw_error(yaw_between(found.frame.rotation, target.frame.rotation), target.symmetry),
        result=mesh if keep_mesh else None,
        **claims(found),
    )


def measure_other(target: ScanTarget, category: str, settings: FitSettings, keep_mesh: bool = False) -> ScanOutcome:
    """Fit a scan of something that is of no known category: only what the fit claims is of interest."""
    found = try_fit(target.scan, settings, up="y")
    truth: dict[str, Any] = {"model_id": target.model_id, "category": category, "symmetry": target.symmetry.name}
    if isinstance(found, FailedFit):
        return ScanOutcome(**truth, failure=found.reason)
    mesh = moved(found.mesh, target.frame) if keep_mesh else None
    return ScanOutcome(**truth, result=mesh, **claims(found))


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
