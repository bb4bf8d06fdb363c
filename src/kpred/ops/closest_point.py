"""Distances from points to the surface of a triangle mesh, exact, by compiled loops."""

from __future__ import annotations

from typing import no_type_check

import numba
import numpy as np

from kpred.ops.typing import Float, Int
from kpred.ops.worksharing import parallel_for

FASTMATH = {"nnan", "nsz", "contract", "reassoc"}

_STEPS = 4
"""Elementary steps of one point and one face."""


def closest_points(
    points: Float[np.ndarray, "points 3"], vertices: Float[np.ndarray, "vertices 3"], faces: Int[np.ndarray, "faces 3"]
) -> tuple[Float[np.ndarray, " points"], Int[np.ndarray, " points"]]:
    """Find the distance from each point to a mesh, and the face nearest to it; one frame and unit.

    Every face is tried, most by the distance from its plane alone: for some thousand points and faces.
    """
    squared, face = np.empty(len(points)), np.empty(len(points), np.int64)
    corners = np.ascontiguousarray(vertices[faces], dtype=np.float64)
    queries = np.ascontiguousarray(points, dtype=np.float64)
    planes = _planes(corners)
    # One row a number, so that those of many faces are computed at a time: box and middle of each face.
    bounds = np.ascontiguousarray(np.concatenate([corners.min(axis=1), corners.max(axis=1), corners.mean(axis=1)], 1).T)
    parallel_for(
        lambda first, last: _closest(queries, corners, planes, bounds, squared, face, first, last),
        len(points),
        _STEPS * len(points) * len(faces),
    )
    return np.sqrt(squared), face


@numba.njit(cache=True, nogil=True)
@no_type_check
def _planes(corners):
    """Compute unit normal and offset (F, 4) of each face's plane; zeros for faces without area."""
    found = np.empty((len(corners), 4))
    for f in range(len(corners)):
        ux, uy, uz = corners[f, 1] - corners[f, 0]
        vx, vy, vz = corners[f, 2] - corners[f, 0]
        nx, ny, nz = uy * vz - uz * vy, uz * vx - ux * vz, ux * vy - uy * vx
        length = max(np.sqrt(nx * nx + ny * ny + nz * nz), 1e-30)
        a = corners[f, 0]
        found[f, 0], found[f, 1], found[f, 2] = nx / length, ny / length, nz / length
        found[f, 3] = (nx * a[0] + ny * a[1] + nz * a[2]) / length
    return found


@numba.njit(cache=True, nogil=True, fastmath=FASTMATH)
@no_type_check
def _bounds(x, y, z, low_x, low_y, low_z, high_x, high_y, high_z, middle_x, middle_y, middle_z, near):
    """Fill `near` (F,) with the squared distance from each face's box; return that from the nearest face's middle."""
    bound = 1e300
    for f in range(len(near)):
        dx, dy, dz = (
            max(low_x[f] - x, x - high_x[f]),
            max(low_y[f] - y, y - high_y[f]),
            max(low_z[f] - z, z - high_z[f]),
        )
        dx, dy, dz = max(dx, 0.0), max(dy, 0.0), max(dz, 0.0)
        near[f] = dx * dx + dy * dy + dz * dz
        dx, dy, dz = x - middle_x[f], y - middle_y[f], z - middle_z[f]
        bound = min(bound, dx * dx + dy * dy + dz * dz)
    return bound


@numba.njit(cache=True, nogil=True)
@no_type_check
def _closest(points, corners, planes, bounds, squared, face, first, last):
    near = np.empty(len(corners))
    for p in range(first, last):
        x, y, z = points[p]
        # A face's middle is on it: no point is farther from the mesh than from the nearest of them.
        bound = _bounds(
            x, y, z, bounds[0], bounds[1], bounds[2], bounds[3], bounds[4], bounds[5], bounds[6], bounds[7], bounds[8],
            near,
        )  # fmt: skip
        squared[p], face[p] = bound * (1.0 + 1e-9) + 1e-300, 0
        for f in range(len(corners)):
            if near[f] >= squared[p]:
                continue
            off = planes[f, 0] * x + planes[f, 1] * y + planes[f, 2] * z - planes[f, 3]
            if off * off >= squared[p]:
                continue
            s, t = _place(x, y, z, corners[f])
            total = 0.0
            for i in range(3):
                at = (1.0 - s - t) * corners[f, 0, i] + s * corners[f, 1, i] + t * corners[f, 2, i]
                total += (points[p, i] - at) ** 2
            if total < squared[p]:
                squared[p] = total
                face[p] = f


@numba.njit(cache=True, nogil=True)
@no_type_check
def _place(x, y, z, corner):
    """Compute weights of the second and third corner in the point of a triangle nearest to (x, y, z)."""
    ux, uy, uz = corner[1] - corner[0]
    vx, vy, vz = corner[2] - corner[0]
    wx, wy, wz = x - corner[0, 0], y - corner[0, 1], z - corner[0, 2]
    uu, uv, vv = ux * ux + uy * uy + uz * uz, ux * vx + uy * vy + uz * vz, vx * vx + vy * vy + vz * vz
    uw, vw = ux * wx + uy * wy + uz * wz, vx * wx + vy * wy + vz * wz
    area = uu * vv - uv * uv
    if area > 1e-30:
        s, t = (vv * uw - uv * vw) / area, (uu * vw - uv * uw) / area
        if s >= 0.0 and t >= 0.0 and s + t <= 1.0:
            return s, t
    # Outside of the triangle, or without area: the nearest of its three edges.
    along_u = min(1.0, max(0.0, uw / max(uu, 1e-30)))
    along_v = min(1.0, max(0.0, vw / max(vv, 1e-30)))
    across = min(1.0, max(0.0, (uu - uv - uw + vw) / max(uu - 2.0 * uv + vv, 1e-30)))
    best_s, best_t, least = along_u, 0.0, 1e30
    for s, t in ((along_u, 0.0), (0.0, along_v), (1.0 - across, across)):
        dx, dy, dz = wx - s * ux - t * vx, wy - s * uy - t * vy, wz - s * uz - t * vz
        squared = dx * dx + dy * dy + dz * dz
        if squared < least:
            best_s, best_t, least = s, t, squared
    return best_s, best_t
