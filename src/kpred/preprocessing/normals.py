"""Surface normals of a point cloud by principal components of each point's neighbours."""

from __future__ import annotations

from typing import no_type_check

import numba
import numpy as np
from scipy.spatial import cKDTree

from kpred.ops.typing import Float, Int
from kpred.ops.worksharing import thread_count


def estimate_normals(
    points: Float[np.ndarray, "points 3"],
    queries: Float[np.ndarray, "queries 3"] | None = None,
    neighbours: int = 12,
) -> tuple[Float[np.ndarray, "queries 3"], Float[np.ndarray, " queries"]]:
    """Estimate unoriented unit normals (Q, 3) at `queries` (default: at every point), in the points' own frame.

    Returns:
        The normals, and how planar each neighbourhood is, in [0, 1]: (middle - least) / largest variance; near 0 on
        a line, at a corner or in noise. With fewer than four points: +z and 0.
    """
    queries = points if queries is None else queries
    if len(points) < 4:
        return np.tile([0.0, 0.0, 1.0], (len(queries), 1)), np.zeros(len(queries))
    tree = cKDTree(points, balanced_tree=False)
    _, index = tree.query(queries, k=min(neighbours, len(points)), workers=thread_count())
    return neighbour_normals(points, index)


def neighbour_normals(
    points: Float[np.ndarray, "points 3"], index: Int[np.ndarray, "queries neighbours"]
) -> tuple[Float[np.ndarray, "queries 3"], Float[np.ndarray, " queries"]]:
    """Estimate normals as `estimate_normals` from given neighbours of each query, at least three."""
    normals, planarity = np.empty((len(index), 3)), np.empty(len(index))
    rows = np.ascontiguousarray(index, dtype=np.int64)
    _principal(np.ascontiguousarray(points, dtype=np.float64), rows, normals, planarity)
    return normals, planarity


@numba.njit(cache=True, nogil=True)
@no_type_check
def _principal(points, index, normals, planarity):
    """Compute the axis of least variance of each neighbourhood, by Jacobi rotations of its covariance."""
    count = index.shape[1]
    tiny = np.finfo(np.float64).tiny
    matrix, axes, middle = np.empty((3, 3)), np.empty((3, 3)), np.empty(3)
    for row in range(len(index)):
        middle[:] = 0.0
        for j in range(count):
            for a in range(3):
                middle[a] += points[index[row, j], a] / count
        # Scaled to the order of one, so that millimetres and kilometres lose no digits.
        largest = tiny
        for j in range(count):
            for a in range(3):
                largest = max(largest, abs(points[index[row, j], a] - middle[a]))
        matrix[:] = 0.0
        for j in range(count):
            for a in range(3):
                for b in range(a, 3):
                    product = (points[index[row, j], a] - middle[a]) / largest
                    matrix[a, b] += product * ((points[index[row, j], b] - middle[b]) / largest)
        axes[:] = 0.0
        for a in range(3):
            axes[a, a] = 1.0
            for b in range(a):
                matrix[a, b] = matrix[b, a]
        for _ in range(12):
            if abs(matrix[0, 1]) + abs(matrix[0, 2]) + abs(matrix[1, 2]) <= 1e-15 * count:
                break
            for p, q in ((0, 1), (0, 2), (1, 2)):
                if matrix[p, q] == 0.0:
                    continue
                theta = (matrix[q, q] - matrix[p, p]) / (2.0 * matrix[p, q])
                t = 1.0 / (abs(theta) + np.sqrt(theta * theta + 1.0))
                t = -t if theta < 0 else t
                c = 1.0 / np.sqrt(t * t + 1.0)
                s = t * c
                for k in range(3):
                    one, two = matrix[k, p], matrix[k, q]
                    matrix[k, p], matrix[k, q] = c * one - s * two, s * one + c * two
                for k in range(3):
                    one, two = matrix[p, k], matrix[q, k]
                    matrix[p, k], matrix[q, k] = c * one - s * two, s * one + c * two
                for k in range(3):
                    one, two = axes[k, p], axes[k, q]
                    axes[k, p], axes[k, q] = c * one - s * two, s * one + c * two
        least = 0
        most = 0
        for a in range(1, 3):
            least = a if matrix[a, a] < matrix[least, least] else least
            most = a if matrix[a, a] >= matrix[most, most] else most
        for a in range(3):  # numba compiles an assignment of arrays for two seconds, this loop for none
            normals[row, a] = axes[a, least]
        between = matrix[0, 0] + matrix[1, 1] + matrix[2, 2] - matrix[least, least] - matrix[most, most]
        planarity[row] = min(1.0, max(0.0, (between - matrix[least, least]) / max(matrix[most, most], tiny)))


def orient_normals(
    normals: Float[np.ndarray, "points 3"],
    points: Float[np.ndarray, "points 3"],
    sensor: Float[np.ndarray, "3"] | None = None,
) -> Float[np.ndarray, "points 3"]:
    """Orient normals (N, 3) towards the sensor, or, without one, away from the middle of the cloud.

    A visible surface faces the sensor, so the first is exact; the second holds for convex surfaces only.
    """
    if len(points) == 0:
        return normals
    outward = points - points.mean(axis=0) if sensor is None else sensor - points
    facing = (normals * outward).sum(axis=1, keepdims=True)
    return np.where(facing < 0, -normals, normals)
