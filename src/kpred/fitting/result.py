"""What a fit gives back: the CAD mesh in the scan's own frame and units, and all that led to it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import trimesh

from kpred.fitting.cleaning import CleaningStep
from kpred.fitting.confidence import Evidence
from kpred.ops.frames import Frame


@dataclass(frozen=True)
class Metric:
    """One number with all it needs to be understood.

    Attributes:
        name: `chamfer_distance`, `unilateral_chamfer_distance`, `mean_scan_to_result`.
        value: the number; unit: its unit; frame: the frame it was measured in.
    """

    name: str
    value: float
    unit: str
    frame: str


@dataclass(frozen=True, eq=False)
class Candidate:
    """A retrieved CAD model.

    Attributes:
        model_id, category: which model of the database.
        distance: weighted L1 distance of its tokens to the scan's.
        error: CD (full scans) or UCD (partial scans) after deformation by the network's keypoints, unit box squared.
            Exact of the chosen one; of others that are not close to the best, or refined, an estimate by some points.
        refined_error: the same after refinement; None where it was not refined, or given up as hopeless on the way.
            Of the chosen candidate it is exact, of others it may be an estimate.
        displacement: (keypoints, 3) of its keypoints, unit box, as chosen for the result.
    """

    model_id: str
    category: str
    distance: float
    error: float
    refined_error: float | None
    displacement: np.ndarray

    @property
    def final_error(self) -> float:
        """The error that the choice between candidates is made by."""
        return self.error if self.refined_error is None else self.refined_error


@dataclass(frozen=True, eq=False)
class Fit:
    """A CAD model fitted to a scan.

    Attributes:
        mesh: the deformed CAD model in the scan's own frame and units.
        retrieved_mesh: the same model as it is in the database, placed in the scan's box.
        source: the chosen candidate; candidates: it and the others that were compared, by error.
        frame: takes the scan into the unit box in which networks and distances work.
        keypoints: (keypoints, 3) of the fitted model, in the scan's frame and units.
        keypoint_confidence: (keypoints,) D_i in [0, 1], how densely the scan shows each keypoint's region.
        confidence: probability that the result is right (`kpred.fitting.confidence`).
        category_confidence: probability of each category tried, most likely first.
        warnings: sentences about what may be wrong with the result, for people.
        category_errors: error of the best quick fit of each category tried, unit box squared, best first.
        cleaning: what each step of cleaning removed.
        partial: whether the scan was taken as partial (one-sided error, partial networks).
        refined: whether keypoints were refined; frame_known: whether the caller vouched for the frame.
        metrics: errors of the result, each with unit and frame.
        timings: seconds per step.
        evidence: what `confidence` was judged by.
    """

    mesh: trimesh.Trimesh
    retrieved_mesh: trimesh.Trimesh
    source: Candidate
    candidates: tuple[Candidate, ...]
    frame: Frame
    keypoints: np.ndarray
    keypoint_confidence: np.ndarray
    confidence: float
    category_confidence: dict[str, float]
    category_errors: dict[str, float]
    cleaning: tuple[CleaningStep, ...]
    partial: bool
    refined: bool
    frame_known: bool
    metrics: tuple[Metric, ...]
    timings: dict[str, float]
    evidence: Evidence
    warnings: tuple[str, ...] = ()

    @property
    def category(self) -> str:
        """Category of the chosen model."""
        return self.source.category

    def to_json(self) -> dict[str, Any]:
        """Everything but the meshes, as plain values."""
        return {
            "model_id": self.source.model_id,
            "category": self.category,
            "confidence": self.confidence,
            "warnings": list(self.warnings),
            "evidence": self.evidence.__dict__,
            "category_confidence": self.category_confidence,
            "category_errors": self.category_errors,
            "cleaning": [step.__dict__ for step in self.cleaning],
            "partial": self.partial,
            "refined": self.refined,
            "frame_known": self.frame_known,
            "metrics": [metric.__dict__ for metric in self.metrics],
            "candidates": [
                {
                    "model_id": candidate.model_id,
                    "category": candidate.category,
                    "token_distance": candidate.distance,
                    "error": candidate.error,
                    "refined_error": candidate.refined_error,
                    "unit": "unit box squared",
                }
                for candidate in self.candidates
            ],
            "keypoints": self.keypoints.tolist(),
            "keypoint_confidence": self.keypoint_confidence.tolist(),
            "unit_box_to_scan": self.frame.matrix().tolist(),
            "timings_seconds": self.timings,
        }
