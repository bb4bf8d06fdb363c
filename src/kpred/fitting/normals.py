"""Surface normals of a point cloud by principal components of each point's neighbours."""

from __future__ import annotations

import numpy as np
from scipy.spatial import cKDTree

from kpred.ops.typing import Float, Int


def estimate_normals(
    points: Float[np.ndarray, "points 3"],
    queries: Float[np.ndarray, "queries 3"] | None = None,
    neighbours: int = 12,
) -> tuple[Float[np.ndarray, "queries 3"], Float[np.ndarray, " queries"]]:
    """Unit normals, without an orientation, at `queries` (default: at every point), in the points' own frame.

    Returns:
        The normals, and how planar each neighbourhood is, in [0, 1]: (middle - smallest) / largest variance; near 0 on
        a line, at a corner or in noise. With fewer than four points: +z and 0.
    """
    queries = points if queries is None else queries
    if len(points) < 4:
        return np.tile([0.0, 0.0, 1.0], (len(queries), 1)), np.zeros(len(queries))
    _, index = cKDTree(points, balanced_tree=False).query(queries, k=min(neighbours, len(points)))
    return neighbour_normals(points, index)


def neighbour_normals(
    points: Float[np.ndarray, "points 3"], index: Int[np.ndarray, "queries neighbours"]
) -> tuple[Float[np.ndarray, "queries 3"], Float[np.ndarray, " queries"]]:
    """`estimate_normals` where the neighbours of each query are known already (three at least)."""
    near = points[index]
    near = near - near.mean(axis=1, keepdims=True)
    # Brought to the order of one, so that millimetres and kilometres lose no digits.
    near = near / max(float(np.abs(near).max()), np.finfo(float).tiny)
    variance, axes = np.linalg.eigh(np.matmul(near.transpose(0, 2, 1), near))
    planarity = (variance[:, 1] - variance[:, 0]) / np.maximum(variance[:, 2], np.finfo(float).tiny)
    return axes[:, :, 0], np.clip(planarity, 0.0, 1.0)


def orient_normals(
    normals: Float[np.ndarray, "points 3"],
    points: Float[np.ndarray, "points 3"],
    sensor: Float[np.ndarray, "3"] | None = None,
) -> Float[np.ndarray, "points 3"]:
    """The normals turned to the sensor, or, where it is unknown, away from the middle of the cloud.

    A visible surface always faces the sensor, so that the first is exact; the second holds for convex outsides only.
    """
    if len(points) == 0:
        return normals
    outward = points - points.mean(axis=0) if sensor is None else sensor - points
    facing = (normals * outward).sum(axis=1, keepdims=True)
    return np.where(facing < 0, -normals, normals)
