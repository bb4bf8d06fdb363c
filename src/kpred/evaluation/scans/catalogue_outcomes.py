"""What a fit makes of the scan of a model that the database holds: whether it is found, and left as it is.

Distances are means from the true surface to a mesh, exact, as fractions of the true longest side.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import trimesh

from kpred.database import Entry
from kpred.evaluation.metrics.surfaces import Surface
from kpred.evaluation.metrics.symmetry import yaw_between, yaw_error
from kpred.evaluation.scans.outcome import YAW_RIGHT, FailedFit, FitOutcome, FitSettings, claims, moved, try_fit
from kpred.evaluation.scans.targets import ScanTarget
from kpred.fitting import Fit
from kpred.ops.typing import Float
from kpred.shapes.structure.cleanliness import thickness_ratios

THIN = 0.15
"""Parts with a side shorter than this, unit box, are boards and bars; those shorter than `FLAT` have no thickness."""

FLAT = 1e-3

THICKNESS_KEPT = 0.1
"""A board whose thickness changed by no more than this fraction has kept it."""


@dataclass(frozen=True, eq=False, kw_only=True)
class CatalogueOutcome(FitOutcome):
    """What became of one scanned model.

    Attributes:
        model_id: of the scanned model; symmetry: name of its symmetry.
        rank: of the scanned model among the candidates, from 1; None: not among them.
        step: how far the result's model was changed; yaw: error in degrees up to symmetry.
        distance: from the true surface to the result; undeformed_distance: to the result's model as it is, placed.
        thickness: of each board of the result against that of the model itself; of the right model alone.
        result: its mesh in the true unit box, if it is wanted.
    """

    model_id: str
    symmetry: str
    rank: int | None = None
    step: str | None = None
    yaw: float | None = None
    distance: float | None = None
    undeformed_distance: float | None = None
    thickness: tuple[float, ...] = ()
    result: trimesh.Trimesh | None = None

    @property
    def first(self) -> bool:
        """Whether the result's model is the scanned one."""
        return self.rank == 1

    @property
    def yaw_right(self) -> bool:
        """Whether the yaw is right within 15 degrees, up to symmetry."""
        return self.yaw is not None and self.yaw <= YAW_RIGHT

    @property
    def ratio(self) -> float | None:
        """Distance to the result / distance to the undeformed model."""
        if self.distance is None or self.undeformed_distance is None:
            return None
        return self.distance / max(self.undeformed_distance, np.finfo(float).tiny)

    def facts(self) -> dict[str, Any]:
        """See `FitOutcome`."""
        return {"ratio": self.ratio}


def measure_catalogue_scan(
    target: ScanTarget, category: str, settings: FitSettings, keep_mesh: bool = False
) -> CatalogueOutcome:
    """Fit the scan of a model of the database, up axis and category given; errors of the fit go to the outcome."""
    truth: dict[str, Any] = {"model_id": target.model_id, "category": category, "symmetry": target.symmetry.name}
    found = try_fit(target.scan, settings, up="y", category=category)
    if isinstance(found, FailedFit):
        return CatalogueOutcome(**truth, failure=found.reason)
    result, undeformed = moved(found.mesh, target.frame), moved(found.retrieved_mesh, target.frame)
    side = float((target.high - target.low).max())
    distance, placed = (float(Surface(mesh).distances(target.whole).mean()) / side for mesh in (result, undeformed))
    return CatalogueOutcome(
        **truth,
        rank=_rank(found, target.model_id),
        step=found.source.step,
        yaw=yaw_error(yaw_between(found.frame.rotation, target.frame.rotation), target.symmetry),
        distance=distance,
        undeformed_distance=placed,
        thickness=tuple(_thickness(found, target)),
        result=result if keep_mesh else None,
        **claims(found),
    )


def board_thickness(entry: Entry, result: Float[np.ndarray, "vertices 3"], size: float) -> Float[np.ndarray, " boards"]:
    """Compute the thickness of each board of a deformed model against the model's own, a ratio.

    Args:
        result: the model's vertices, deformed; size: of one unit of the model's unit box there.
    """
    source = entry.frame.to_unit(entry.mesh.vertices.astype(np.float64))
    sides = np.ptp(entry.structure.boxes, axis=1).min(axis=1)
    ratios = thickness_ratios(source, result, entry.structure, size)
    boards: np.ndarray = ratios[(sides > FLAT) & (sides < THIN)]
    return boards


def _rank(found: Fit, model_id: str) -> int | None:
    names = [candidate.model_id for candidate in found.candidates]
    return names.index(model_id) + 1 if model_id in names else None


def _thickness(found: Fit, target: ScanTarget) -> list[float]:
    """Measure boards of the right model alone: the size of another means nothing."""
    if found.source.model_id != target.model_id:
        return []
    vertices = target.frame.to_unit(np.asarray(found.mesh.vertices, dtype=np.float64))
    return board_thickness(found.placed.entry, vertices, 1.0).tolist()
