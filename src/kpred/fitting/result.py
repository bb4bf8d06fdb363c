"""Result of a fit: the CAD mesh in the scan's own frame and units, and all intermediate results."""

from __future__ import annotations

import os
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from functools import cached_property
from importlib import import_module
from pathlib import Path
from typing import Any

import numpy as np
import trimesh

from kpred.exports.furniture import WOOD
from kpred.fitting.confidence import Evidence
from kpred.fitting.placed import Placed, PlacedModel
from kpred.fitting.source import FitSource
from kpred.ops.frames import Frame
from kpred.ops.typing import Float
from kpred.preprocessing.clean import CleaningStep
from kpred.refinement.score import Step
from kpred.shapes.appearance.appearance import Appearance
from kpred.shapes.credit import Credit
from kpred.shapes.structure.cleanliness import Cleanliness, measure_cleanliness
from kpred.shapes.unit import LengthUnit


@dataclass(frozen=True)
class Metric:
    """One number with all it needs to be understood.

    Attributes:
        name: `unilateral_chamfer_distance` (scan to result), `chamfer_distance` (both ways) or, where parts are unseen,
            `seen_chamfer_distance` (the result's seen surface alone on the way back), `mean_scan_to_result` (to its
            surface).
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
        step: how far it was changed: `none`, `scale`, `structure`, `free` or `paper`.
        error: Chamfer distance after that, of what is seen, unit box squared, by some points.
        score: log error and cost of the change, by which candidates are compared; the lower the better.
        final: whether it was deformed to the end; otherwise error and score are estimates from above.
        read_mesh: deforms its mesh; `mesh` keeps it.
    """

    model_id: str
    category: str
    distance: float
    step: Step
    error: float
    score: float
    final: bool
    read_mesh: Callable[[], trimesh.Trimesh] = field(repr=False)

    @cached_property
    def mesh(self) -> trimesh.Trimesh:
        """The deformed mesh in the scan's frame and units, made at first use.

        Raises:
            DatabaseError: the model is no longer in the database, or this is closed.
        """
        return self.read_mesh()


@dataclass(frozen=True, eq=False)
class Fit:
    """A CAD model fitted to a scan.

    Attributes:
        mesh: the deformed CAD model in the scan's own frame and units.
        retrieved_mesh: the same model as it is in the database, placed in the scan.
        placement: where that model stands: from its own coordinates to the scan's.
        source: the chosen candidate; candidates: it and the others that were compared, best first.
        frame: takes the scan into the unit box in which networks and distances work.
        points: (N, 3) of the scan that were fitted: at most 2048, after cleaning, in the scan's frame and units.
        keypoints: (keypoints, 3) of the fitted model, in the scan's frame and units.
        keypoint_confidence: (keypoints,) D_i in [0, 1], how densely the scan shows each keypoint's region.
        confidence: probability that the result is right (`kpred.fitting.confidence`).
        category_confidence: probability of each category tried, most likely first.
        warnings: sentences about what may be wrong with the result, for people.
        category_errors: error of the best quick fit of each category tried, unit box squared, best first.
        cleaning: what each step of cleaning removed.
        partial: whether the networks for partial scans encoded it; seen: mean visibility of the result's surface.
        unit: of the scan, given or guessed from the object's size.
        deform: how far models were allowed to be changed; frame_known: whether the caller vouched for the frame.
        metrics: errors of the result, each with unit and frame.
        timings: seconds per step.
        evidence: what `confidence` rests on.
    """

    mesh: trimesh.Trimesh
    retrieved_mesh: trimesh.Trimesh
    placement: PlacedModel
    source: Candidate
    candidates: tuple[Candidate, ...]
    frame: Frame
    points: Float[np.ndarray, "points 3"] = field(repr=False)
    keypoints: np.ndarray
    keypoint_confidence: np.ndarray
    confidence: float
    category_confidence: dict[str, float]
    category_errors: dict[str, float]
    cleaning: tuple[CleaningStep, ...]
    partial: bool
    seen: float
    unit: LengthUnit
    deform: str
    frame_known: bool
    metrics: tuple[Metric, ...]
    timings: dict[str, float]
    evidence: Evidence
    placed: Placed = field(repr=False)
    source_data: FitSource = field(repr=False)
    read_appearance: Callable[[], Appearance | None] = field(repr=False)
    warnings: tuple[str, ...] = ()

    @property
    def category(self) -> str:
        """Category of the chosen model."""
        return self.source.category

    @property
    def up(self) -> Float[np.ndarray, "3"]:
        """Direction that points up in the scan's frame, (3,) of length one."""
        return self.frame.rotation[1]

    @property
    def details(self) -> dict[str, str]:
        """What the database says of the chosen model: title, author, licence, source, size, split, ..."""
        return dict(self.placed.entry.metadata)

    @property
    def credit(self) -> Credit:
        """What is written into files of the result: the model, its author, licence and source, what was changed."""
        facts = {"confidence": self.confidence, "step": self.source.step}
        changes = "placed" if self.source.step == "none" else "placed and deformed"
        return Credit(self.source.model_id, self.category, self.details, changes, facts)

    def save(self, path: str | os.PathLike[str], density: float = WOOD) -> list[Path]:
        """Write the result in the format of the extension (`kpred.exports.format_table`), and return the files.

        Args:
            density: kg per cubic metre, for simulations.

        Raises:
            OutputError: unknown extension, its library is not installed, or a file cannot be written there.
        """
        from kpred.fitting.export import save_result

        return save_result(self, path, density)

    def record(self) -> dict[str, Any]:
        """Return the record as plain values: all but the meshes, and all that makes the fit again (`kpred refit`).

        Raises:
            ScanError: the scan's file is gone. DatabaseError: the database is closed.
        """
        from kpred.fitting.record import make_record

        return make_record(self)

    def candidate(self, rank: int) -> trimesh.Trimesh:
        """Deform the mesh of the candidate of this rank, 0 being the result; in the scan's frame and units.

        Raises:
            IndexError: there are not so many candidates.
            DatabaseError: the model is no longer in the database.
        """
        return self.candidates[range(len(self.candidates))[rank]].mesh.copy()

    def show(self, path: str | os.PathLike[str] | None = None) -> Path:
        """Write a page with picture, numbers and warnings, open it in the browser, and return its file.

        Args:
            path: of the page (.html); None makes a temporary file.
        """
        return _page().show_fit(self, path)

    def _repr_html_(self) -> str:
        """Return what notebooks show: picture, numbers and warnings as HTML."""
        return _page().fit_html(self)

    def rotated(self, rotation: Float[np.ndarray, "3 3"]) -> Fit:
        """Return the same fit in a rotated frame of the scan: a point p is at `rotation @ p` there."""
        matrix = np.eye(4)
        matrix[:3, :3] = rotation
        placement = replace(
            self.placement,
            matrix=matrix @ self.placement.matrix,
            translation=rotation @ self.placement.translation,
            rotation=rotation @ self.placement.rotation,
        )
        frame = replace(
            self.frame, center=rotation @ self.frame.center, rotation=self.frame.rotation @ np.asarray(rotation).T
        )
        return replace(
            self,
            mesh=self.mesh.copy().apply_transform(matrix),
            retrieved_mesh=self.retrieved_mesh.copy().apply_transform(matrix),
            placement=placement,
            frame=frame,
            points=self.points @ rotation.T,
            keypoints=self.keypoints @ rotation.T,
            candidates=tuple(_rotated(one, matrix) for one in self.candidates),
        )

    @cached_property
    def cleanliness(self) -> Cleanliness:
        """How far the mesh is still CAD: flat, straight, square, mirrored, whole at its contacts."""
        entry = self.placed.entry
        source = entry.frame.to_unit(entry.mesh.vertices.astype(np.float64))
        result = self.frame.to_unit(np.asarray(self.mesh.vertices, dtype=np.float64))
        return measure_cleanliness(source, result, np.asarray(entry.mesh.faces), entry.structure)

    def to_json(self) -> dict[str, Any]:
        """Return everything but the meshes, as plain values."""
        return {
            "model_id": self.source.model_id,
            "category": self.category,
            "catalogue": self.details,
            "confidence": self.confidence,
            "warnings": list(self.warnings),
            "deform": self.deform,
            "step": self.source.step,
            "model_to_scan": {
                "matrix": self.placement.matrix.tolist(),
                "translation": self.placement.translation.tolist(),
                "rotation": self.placement.rotation.tolist(),
                "scale": self.placement.scale.tolist(),
                "own_size": self.placement.own_size,
                "resized": self.placement.resized,
            },
            "cleanliness": self.cleanliness.to_json(),
            "evidence": self.evidence.__dict__,
            "category_confidence": self.category_confidence,
            "category_errors": self.category_errors,
            "cleaning": [step.__dict__ for step in self.cleaning],
            "partial": self.partial,
            "seen": self.seen,
            "frame_known": self.frame_known,
            "up": self.up.tolist(),
            "unit": {"name": self.unit.name, "metres": self.unit.metres, "origin": self.unit.origin},
            "size": np.ptp(self.mesh.bounds, axis=0).tolist(),
            "triangles": len(self.mesh.faces),
            "metrics": [metric.__dict__ for metric in self.metrics],
            "candidates": [
                {
                    "model_id": candidate.model_id,
                    "category": candidate.category,
                    "token_distance": candidate.distance,
                    "step": candidate.step,
                    "error": candidate.error,
                    "unit": "unit box squared",
                    "score": candidate.score,
                    "final": candidate.final,
                }
                for candidate in self.candidates
            ],
            "keypoints": self.keypoints.tolist(),
            "keypoint_confidence": self.keypoint_confidence.tolist(),
            "unit_box_to_scan": self.frame.matrix().tolist(),
            "timings_seconds": self.timings,
        }


def _page() -> Any:
    # Pictures stand on a higher floor: loaded by name, and only when needed.
    return import_module("kpred.rendering.page")


def _rotated(candidate: Candidate, matrix: Float[np.ndarray, "4 4"]) -> Candidate:
    return replace(candidate, read_mesh=lambda: candidate.mesh.copy().apply_transform(matrix))
