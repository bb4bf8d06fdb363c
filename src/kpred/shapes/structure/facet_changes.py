"""What a deformation took from the planar facets of a mesh: flatness, parallel planes, planes along the axes."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from kpred.ops.typing import Float, Int
from kpred.shapes.structure.edge_pairs import FaceFrames, direction_keys, line_angles, pairs_in_groups
from kpred.shapes.structure.groups import group_spreads
from kpred.shapes.structure.structure import Structure
from kpred.shapes.structure.weighted import weighted_mean, weighted_quantile

ALIGNED_ANGLE = 1.0
"""Facets within so many degrees of each other are parallel, of an axis along it."""

_PAIR_REACH = 3


@dataclass(frozen=True)
class FacetChanges:
    """Facet measures, as in `kpred.shapes.structure.cleanliness.Cleanliness`."""

    flatness: float
    parallelism: float
    axis_tilt: float
    axis_tilt_95: float


def measure_facets(
    source: Float[np.ndarray, "vertices 3"],
    result: Float[np.ndarray, "vertices 3"],
    faces: Int[np.ndarray, "faces 3"],
    frames: tuple[FaceFrames, FaceFrames],
    structure: Structure,
) -> FacetChanges:
    """Measure the planar facets of a deformed mesh against its source, both in the unit box: fractions and degrees.

    Args:
        frames: of the faces in the source and in the result.
    """
    kept = np.flatnonzero(structure.facets >= 0)
    if not len(kept):
        return FacetChanges(0.0, 0.0, 0.0, 0.0)
    facets, count = structure.facets[kept].astype(np.int64), int(structure.facets.max()) + 1
    areas = np.bincount(facets, frames[0].areas[kept], count)
    # Each vertex counts once a facet, however many of its faces meet there.
    pairs = np.unique(facets[:, None] * len(source) + faces[kept])
    group, vertex = pairs // len(source), pairs % len(source)
    off_plane = [group_spreads(vertices[vertex], group, count)[:, 0] for vertices in (source, result)]
    before, after = _facet_normals(frames, kept, facets, count)
    measured = np.where((before != 0).any(axis=1) & (after != 0).any(axis=1), areas, 0.0)
    tilts, aligned = _tilts(before, after, measured)
    return FacetChanges(
        flatness=weighted_mean(np.maximum(off_plane[1] - off_plane[0], 0.0), areas),
        parallelism=_parallelism(before, after, measured, _facet_parts(faces[kept], facets, count, structure)),
        axis_tilt=weighted_mean(tilts, aligned),
        axis_tilt_95=weighted_quantile(tilts, aligned, 0.95),
    )


def _facet_normals(
    frames: tuple[FaceFrames, FaceFrames], kept: np.ndarray, facets: np.ndarray, count: int
) -> tuple[np.ndarray, np.ndarray]:
    """Compute unit normals (count, 3) of the facets in source and result, weighted by area."""
    normals, areas = frames[0].normals[kept], frames[0].areas[kept]
    largest = np.zeros((count, 3))
    by_area = np.argsort(areas, kind="stable")
    largest[facets[by_area]] = normals[by_area]
    # Winding is not reliable: in the source, a facet's faces are given one side; in the result they keep their signs.
    signs = np.where(np.einsum("fi,fi->f", normals, largest[facets]) < 0, -1.0, 1.0)
    found = []
    for frame in frames:
        weighted = frame.normals[kept] * (signs * frame.areas[kept])[:, None]
        sums = np.stack([np.bincount(facets, weighted[:, k], count) for k in range(3)], axis=1)
        found.append(sums / np.maximum(np.linalg.norm(sums, axis=1, keepdims=True), 1e-300))
    return found[0], found[1]


def _tilts(before: np.ndarray, after: np.ndarray, areas: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Measure degrees that facets tilt from the nearest axis beyond the source, and their weights."""
    axes = np.eye(3)[np.abs(before).argmax(axis=1)]
    tilt = line_angles(before, axes)
    return np.maximum(line_angles(after, axes) - tilt, 0.0), np.where(tilt <= ALIGNED_ANGLE, areas, 0.0)


def _parallelism(before: np.ndarray, after: np.ndarray, areas: np.ndarray, parts: np.ndarray) -> float:
    """Measure mean degrees between a part's once parallel facets, beyond the source's, by smaller area."""
    # Of many facets of a part only those of similar directions are compared.
    first, second = pairs_in_groups(parts, direction_keys(before), _PAIR_REACH)
    angle = line_angles(before[first], before[second])
    growth = np.maximum(line_angles(after[first], after[second]) - angle, 0.0)
    weight = np.where(angle <= ALIGNED_ANGLE, np.minimum(areas[first], areas[second]), 0.0)
    return weighted_mean(growth, weight)


def _facet_parts(faces: np.ndarray, facets: np.ndarray, count: int, structure: Structure) -> np.ndarray:
    """Return the part (count,) of each facet; -1 for numbers that no face has."""
    parts = np.full(count, -1)
    parts[facets] = structure.vertex_parts[faces[:, 0]]
    return parts
