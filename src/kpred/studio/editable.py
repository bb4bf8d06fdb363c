"""From a fit to the shape that a person corrects, and back to a fit with the corrected mesh."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import trimesh

from kpred.database import Entry
from kpred.fitting.explanation import Explanation
from kpred.fitting.placed import SURFACE_POINTS
from kpred.fitting.result import Fit
from kpred.ops.closest_point import closest_points
from kpred.ops.typing import Float
from kpred.refinement.part_points import PartPoints, affine_solution
from kpred.refinement.structure_basis import StructureBasis, structure_basis
from kpred.refinement.structure_config import StructureConfig
from kpred.studio.shape import Shape
from kpred.studio.smooth_shape import SmoothModel, SmoothShape
from kpred.studio.structure_shape import StructureModel, StructureShape

MIRRORED = 0.15
"""Keypoints are a pair if each is so near to the other's mirror image, unit box of the model."""


def editable_shape(fit: Fit, config: StructureConfig) -> Shape:
    """Make the shape of a fit's result, in the scan's unit box, ready to be corrected."""
    entry, explanation = fit.placed.entry, fit.placed.explanation
    if explanation.step in ("free", "paper"):
        model = SmoothModel(
            fit.frame.to_unit(np.asarray(fit.mesh.vertices, dtype=np.float64)),
            fit.frame.to_unit(fit.keypoints),
            explanation.points.astype(np.float64),
            entry.vertex_basis.astype(np.float64),
            entry.point_basis.astype(np.float64),
        )
        return SmoothShape(model, np.zeros_like(fit.keypoints))
    basis = structure_basis(entry.structure, config) if explanation.structure is None else explanation.structure.basis
    return StructureShape(structure_model(entry, basis), _solution(explanation, basis))


def structure_model(entry: Entry, basis: StructureBasis) -> StructureModel:
    """Make ready all points of a model that corrections move."""
    vertices = entry.frame.to_unit(entry.mesh.vertices.astype(np.float64))
    keypoints = entry.keypoints.astype(np.float64)
    # A keypoint moves with the part of the vertex nearest to it.
    nearest = np.square(keypoints[:, None] - vertices[None]).sum(axis=2).argmin(axis=1)
    parts = entry.structure.vertex_parts.astype(np.int64)
    return StructureModel(
        basis,
        PartPoints(basis, vertices, parts),
        PartPoints(basis, keypoints, parts[nearest]),
        PartPoints(basis, entry.points.astype(np.float64), entry.point_parts.astype(np.int64)),
    )


def _solution(explanation: Explanation, basis: StructureBasis) -> np.ndarray:
    if explanation.structure is not None:
        return explanation.structure.solution.copy()
    return affine_solution(basis, explanation.placement.size, explanation.placement.shift)


def mirror_pairs(entry: Entry) -> tuple[int, ...]:
    """List for each keypoint the one on the other side (itself in the middle), or -1 where the model has none."""
    keypoints = entry.keypoints.astype(np.float64)
    middle = float(entry.structure.mirror)
    if not np.isfinite(middle):
        return (-1,) * len(keypoints)
    mirrored = keypoints.copy()
    mirrored[:, 0] = 2.0 * middle - mirrored[:, 0]
    apart = np.linalg.norm(mirrored[:, None] - keypoints[None], axis=2)
    nearest = apart.argmin(axis=1)
    pairs = (nearest[nearest] == np.arange(len(nearest))) & (apart.min(axis=1) < MIRRORED)
    return tuple(int(one) if pair else -1 for one, pair in zip(nearest, pairs, strict=True))


def corrected_fit(fit: Fit, shape: Shape, points: Float[np.ndarray, "points 3"]) -> Fit:
    """Return the fit with the corrected mesh, keypoints and distance; `points` are the scan's.

    Errors in the unit box are those of the fit before and are left out.
    """
    vertices = fit.frame.from_unit(shape.vertices)
    mesh = trimesh.Trimesh(vertices, np.asarray(fit.mesh.faces).copy(), process=False)
    some = points[:: max(1, len(points) // SURFACE_POINTS)]
    surface, _ = closest_points(fit.frame.to_unit(some), shape.vertices, np.asarray(fit.mesh.faces))
    distance = float(surface.mean()) * fit.frame.scale
    metrics = tuple(replace(metric, value=distance) for metric in fit.metrics if metric.name == "mean_scan_to_result")
    step = fit.source.step if fit.source.step in ("free", "paper") else "structure"
    return replace(
        fit,
        mesh=mesh,
        keypoints=fit.frame.from_unit(shape.keypoints),
        source=replace(fit.source, step=step),
        metrics=metrics,
        warnings=(*fit.warnings, "The shape was corrected by hand."),
    )
