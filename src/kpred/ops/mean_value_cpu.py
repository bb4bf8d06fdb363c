"""Compiled mean value coordinates for the CPU: one point at a time against all faces, points in parallel.

The formula and its limits are those of `kpred.ops.mean_value.mean_value_reference`; a test holds the two equal.
"""

from __future__ import annotations

from math import atan2, pi, sin, sqrt
from typing import no_type_check

import numba
import numpy as np

from kpred.ops.worksharing import parallel_for


@numba.njit(cache=True, nogil=True)
@no_type_check
def _coordinates(points, cage, faces, weights, start, end):
    count = points.shape[1]
    vertices = cage.shape[1]
    for job in range(start, end):
        b, p = job // count, job % count
        direction = np.empty((vertices, 3))
        distance = np.empty(vertices)
        total = np.zeros(vertices)
        nearest = _directions(points[b, p], cage[b], direction, distance)
        if nearest >= 0:
            weights[b, p, nearest] = 1.0
            continue
        cross = np.empty((3, 3))
        angle = np.empty(3)
        for f in range(faces.shape[0]):
            mx, my, mz = _edge_normals(direction, faces[f], cross, angle)
            if pi - (angle[0] + angle[1] + angle[2]) / 2.0 < 1e-6:
                # On this face: its barycentric weights are the limit.
                total[:] = 0.0
                for i in range(3):
                    j, k = faces[f, (i + 1) % 3], faces[f, (i + 2) % 3]
                    total[faces[f, i]] = sin(angle[i]) * distance[j] * distance[k]
                break
            first = faces[f, 0]
            determinant = (
                direction[first, 0] * cross[0, 0]
                + direction[first, 1] * cross[0, 1]
                + direction[first, 2] * cross[0, 2]
            )
            if abs(determinant) < 1e-10:
                continue
            for i in range(3):
                v = faces[f, i]
                projection = mx * cross[i, 0] + my * cross[i, 1] + mz * cross[i, 2]
                total[v] += projection / (determinant * max(distance[v], 1e-300))
        scale = 1.0 / total.sum()
        for v in range(vertices):
            weights[b, p, v] = total[v] * scale


@numba.njit(cache=True, nogil=True)
@no_type_check
def _directions(point, cage, direction, distance):
    """Write directions (V, 3) and distances (V,) to a cage's vertices; return the one the point lies on, else -1."""
    size, nearest = 1e-12, 0
    for v in range(len(cage)):
        dx, dy, dz = cage[v, 0] - point[0], cage[v, 1] - point[1], cage[v, 2] - point[2]
        length = sqrt(dx * dx + dy * dy + dz * dz)
        reach = sqrt(cage[v, 0] ** 2 + cage[v, 1] ** 2 + cage[v, 2] ** 2)
        size = max(size, reach)
        distance[v] = length
        if length < distance[nearest]:
            nearest = v
        inverse = 1.0 / max(length, 1e-300)
        direction[v, 0], direction[v, 1], direction[v, 2] = dx * inverse, dy * inverse, dz * inverse
    return nearest if distance[nearest] < 1e-9 * size else -1


@numba.njit(cache=True, nogil=True)
@no_type_check
def _edge_normals(direction, face, cross, angle):
    """Write normals (3, 3) and angles (3,) of a face's edges as the point sees them; return the mean vector."""
    mx, my, mz = 0.0, 0.0, 0.0
    for i in range(3):
        # cross[i] is normal to the plane through the point and the edge opposite corner i.
        j, k = face[(i + 1) % 3], face[(i + 2) % 3]
        cx = direction[j, 1] * direction[k, 2] - direction[j, 2] * direction[k, 1]
        cy = direction[j, 2] * direction[k, 0] - direction[j, 0] * direction[k, 2]
        cz = direction[j, 0] * direction[k, 1] - direction[j, 1] * direction[k, 0]
        dot = direction[j, 0] * direction[k, 0] + direction[j, 1] * direction[k, 1] + direction[j, 2] * direction[k, 2]
        length = sqrt(cx * cx + cy * cy + cz * cz)
        angle[i] = atan2(length, dot)
        half_angle = angle[i] / max(length, 1e-300) / 2.0
        mx, my, mz = mx + half_angle * cx, my + half_angle * cy, mz + half_angle * cz
        cross[i, 0], cross[i, 1], cross[i, 2] = cx, cy, cz
    return mx, my, mz


def mean_value_cpu(points: np.ndarray, cage: np.ndarray, faces: np.ndarray) -> np.ndarray:
    """Compute coordinates (B, N, V) float64 of points (B, N, 3) in cages (B, V, 3), faces (F, 3)."""
    weights = np.zeros((*points.shape[:2], cage.shape[1]))
    arrays = points.astype(np.float64), cage.astype(np.float64), faces.astype(np.int64), weights
    jobs = weights.shape[0] * weights.shape[1]
    parallel_for(lambda first, last: _coordinates(*arrays, first, last), jobs, 20 * jobs * len(faces))
    return weights
