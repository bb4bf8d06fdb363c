"""Where a database model's points lie on its mesh, so that they move as the mesh does.

A mesh of few large faces follows a warp only at its corners. Points that are moved by themselves would report a smaller
error than the mesh that is delivered has; points that are carried by their faces report the mesh's own.
"""

from __future__ import annotations

import zlib
from collections import OrderedDict
from dataclasses import dataclass
from threading import Lock
from typing import no_type_check
from weakref import WeakKeyDictionary

import numba
import numpy as np
import torch
from torch import Tensor

from kpred.database import Database
from kpred.ops.lattice import SIZE, lattice_weights
from kpred.ops.lattice_cpu import carried_lattice_weights
from kpred.ops.typing import Float, Int

MOST_FACES = 8192
"""A mesh of more faces follows a smooth warp as its points do."""

_KEPT_MODELS = 1024
"""Models of a database whose surfaces are kept in memory: some 50 kB each."""


@dataclass(frozen=True, eq=False)
class SurfacePoints:
    """V vertices, N points.

    Attributes:
        vertices: (V, 3) of the mesh, unit box.
        corners: (N, 3) indices of the vertices of each point's face; None for a mesh of more than `MOST_FACES`.
        shares: (N, 3) of these vertices in the point.
    """

    vertices: Tensor
    corners: Tensor | None
    shares: Tensor | None

    def lattice_columns(
        self, points: Float[Tensor, "points 3"], half: Float[Tensor, "3"]
    ) -> Float[Tensor, "points controls"]:
        """Weights of the control points of a lattice, whose box reaches from -half to half, at the points (unit box).

        They are carried by their faces' corners; those of a mesh of many faces move by themselves.
        """
        if self.corners is None or self.shares is None:
            return lattice_weights(points, -half, half)
        arrays = (self.vertices, self.corners, self.shares, -half, half)
        return torch.from_numpy(carried_lattice_weights(*(array.numpy() for array in arrays), size=SIZE))


_kept: WeakKeyDictionary[Database, OrderedDict[tuple[str, int], SurfacePoints]] = WeakKeyDictionary()
_lock = Lock()


def surface_points(database: Database, model_id: str, points: Float[Tensor, "points 3"]) -> SurfacePoints:
    """Of one model of a database, whose points these are (unit box); kept in memory while the database is.

    Raises:
        DatabaseError: the model is not in the database.
    """
    key = model_id, zlib.crc32(points.numpy().tobytes())
    with _lock:
        found = _kept.setdefault(database, OrderedDict())
        if key in found:
            found.move_to_end(key)
            return found[key]
    entry = database.entry(model_id)
    vertices = entry.frame.to_unit(entry.mesh.vertices.astype(np.float64)).astype(np.float32)
    corners: Tensor | None = None
    shares: Tensor | None = None
    if len(entry.mesh.faces) <= MOST_FACES:
        face, weights = closest_faces(points.numpy(), vertices, entry.mesh.faces)
        corners, shares = torch.from_numpy(entry.mesh.faces[face].astype(np.int64)), torch.from_numpy(weights)
    made = SurfacePoints(torch.from_numpy(vertices), corners, shares)
    with _lock:
        found[key] = made
        while len(found) > _KEPT_MODELS:
            found.popitem(last=False)
    return made


def closest_faces(
    points: Float[np.ndarray, "points 3"], vertices: Float[np.ndarray, "vertices 3"], faces: Int[np.ndarray, "faces 3"]
) -> tuple[Int[np.ndarray, " points"], Float[np.ndarray, "points 3"]]:
    """The face nearest to each point, and the shares of its three corners in the nearest place on it; one frame."""
    face = np.empty(len(points), np.int64)
    shares = np.empty((len(points), 3), np.float32)
    corners = vertices[faces].astype(np.float64)
    _closest(points.astype(np.float64), corners, face, shares)
    return face, shares


@numba.njit(cache=True)
@no_type_check
def _closest(points, corners, face, shares):
    count = len(corners)
    normal = np.empty((count, 4))
    for f in range(count):
        ux, uy, uz = corners[f, 1] - corners[f, 0]
        vx, vy, vz = corners[f, 2] - corners[f, 0]
        nx, ny, nz = uy * vz - uz * vy, uz * vx - ux * vz, ux * vy - uy * vx
        length = max(np.sqrt(nx * nx + ny * ny + nz * nz), 1e-30)
        normal[f, 0], normal[f, 1], normal[f, 2] = nx / length, ny / length, nz / length
        a = corners[f, 0]
        normal[f, 3] = (nx * a[0] + ny * a[1] + nz * a[2]) / length
    for p in range(len(points)):
        x, y, z = points[p]
        best = 1e30
        for f in range(count):
            off = normal[f, 0] * x + normal[f, 1] * y + normal[f, 2] * z - normal[f, 3]
            if off * off >= best:
                continue
            s, t = _place(x, y, z, corners[f])
            squared = 0.0
            for i in range(3):
                at = (1.0 - s - t) * corners[f, 0, i] + s * corners[f, 1, i] + t * corners[f, 2, i]
                squared += (points[p, i] - at) ** 2
            if squared < best:
                best = squared
                face[p] = f
                shares[p, 0], shares[p, 1], shares[p, 2] = 1.0 - s - t, s, t


@numba.njit(cache=True)
@no_type_check
def _place(x, y, z, corner):
    """Shares of the second and third corner in the point of a triangle that is nearest to (x, y, z)."""
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
