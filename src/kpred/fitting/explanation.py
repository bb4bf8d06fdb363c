"""What deforming a candidate gives: the change, the deformed points, and how well they explain the scan."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from kpred.fitting.candidates import Candidates
from kpred.fitting.visibility import Visibility
from kpred.ops.typing import Float, Int
from kpred.refinement.placement import Placement
from kpred.refinement.score import Distances, Step
from kpred.refinement.structure_fit import StructureMap


@dataclass(frozen=True, eq=False)
class ModelPoints:
    """Points of one model: of its surface, or the vertices of its mesh; unit box.

    Attributes:
        points: (N, 3); parts: (N,); basis: (N, K) deformation basis.
    """

    points: Float[np.ndarray, "points 3"]
    parts: Int[np.ndarray, " points"]
    basis: Float[np.ndarray, "points keypoints"]


Deformation = Callable[[ModelPoints], np.ndarray]
"""From points of a model, unit box, to where they go, (N, 3)."""


@dataclass(frozen=True, eq=False)
class Explanation:
    """One candidate, deformed to the scan.

    Attributes:
        step: how far the model was changed; deformation: the change.
        points: (N, 3) of the deformed surface, float32, the scan's unit box.
        distances: between it and the scan; score: log error and cost, the lower the better.
        placement: of the undeformed model; structure: unknowns of the structure-keeping map, if it is one.
        final: whether it was deformed to the end; others are estimates.
    """

    step: Step
    deformation: Deformation
    points: Float[np.ndarray, "points 3"]
    distances: Distances
    score: float
    placement: Placement
    structure: StructureMap | None = None
    final: bool = True


@dataclass(frozen=True, eq=False)
class Deformed:
    """The candidates of one hypothesis, each with its best explanation, in the order of retrieval.

    Attributes:
        candidates: as they were retrieved; visibility: of places in the scan's unit box; seen: its mean over results.
    """

    candidates: Candidates
    visibility: Visibility
    explanations: tuple[Explanation, ...]
    seen: float
