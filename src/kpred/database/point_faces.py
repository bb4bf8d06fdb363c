"""Which face of a mesh each point was sampled on, found again from their positions: databases do not store it."""

from __future__ import annotations

import numpy as np

from kpred.ops.typing import Float, Int

_REACH = 1e-4
"""Stored points are so near to their face, unit box."""

_PAIRS = 4_000_000
"""Pairs of points and faces compared at once: some ten megabytes."""


def faces_of_points(
    points: Float[np.ndarray, "points 3"], vertices: Float[np.ndarray, "vertices 3"], faces: Int[np.ndarray, "faces 3"]
) -> Int[np.ndarray, " points"]:
    """Find the face nearest to each point, the first of those equally near; points lie on the surface, unit box.

    Points off the surface have one too, found more slowly.
    """
    positions, corners = np.asarray(points, np.float64), np.asarray(vertices, np.float64)[faces]
    found = np.full(len(positions), -1, np.int64)
    reach = _REACH
    while (missing := np.flatnonzero(found < 0)).size:
        step = max(1, _PAIRS // len(faces))
        for start in range(0, len(missing), step):
            rows = missing[start : start + step]
            found[rows] = _nearest_within(positions[rows], corners, reach)
        reach *= 8.0
    return found


def _nearest_within(points: np.ndarray, corners: np.ndarray, reach: float) -> np.ndarray:
    """Find the nearest face (N,) within `reach` of each point, or -1."""
    low, high = corners.min(axis=1) - reach, corners.max(axis=1) + reach
    inside = np.ones((len(points), len(corners)), bool)
    for axis in range(3):
        at = points[:, axis, None]
        inside &= (at >= low[:, axis]) & (at <= high[:, axis])
    point, face = np.nonzero(inside)
    squared = _squared_distances(points[point], corners[face])
    order = np.lexsort((face, squared, point))
    order = order[squared[order] <= reach**2]
    first = order[np.unique(point[order], return_index=True)[1]]
    found = np.full(len(points), -1, np.int64)
    found[point[first]] = face[first]
    return found


def _squared_distances(points: np.ndarray, corners: np.ndarray) -> np.ndarray:
    """Compute the squared distance (P,) of each point to its own triangle, corners (P, 3, 3)."""
    edges = np.roll(corners, -1, axis=1) - corners
    offsets = points[:, None] - corners
    lengths = np.maximum(np.einsum("pij,pij->pi", edges, edges), 1e-300)
    along = np.clip(np.einsum("pij,pij->pi", offsets, edges) / lengths, 0.0, 1.0)
    off_edges = offsets - along[..., None] * edges
    nearest: np.ndarray = np.einsum("pij,pij->pi", off_edges, off_edges).min(axis=1)
    normal = np.cross(edges[:, 0], edges[:, 1])
    square = np.einsum("pj,pj->p", normal, normal)
    # Inside of all three edges, seen along the normal, the plane is nearest.
    inward = np.einsum("pij,pij->pi", np.cross(normal[:, None], edges), offsets)
    above = (inward >= 0).all(axis=1) & (square > 0)
    height = np.einsum("pj,pj->p", normal, offsets[:, 0]) ** 2 / np.maximum(square, 1e-300)
    return np.where(above, height, nearest)
