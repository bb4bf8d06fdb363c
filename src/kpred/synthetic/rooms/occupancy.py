"""Voxels of a room that surfaces pass through: whether something fits where it is put."""

from __future__ import annotations

from typing import no_type_check

import numba
import numpy as np
from scipy import ndimage

from kpred.shapes.mesh import Mesh

CELL = 0.04
"""Side of a voxel, metres."""


class Occupancy:
    """Which voxels of a room hold surface.

    Args:
        size: (3,) of the room, metres; its floor is at y = 0, its middle at the origin.
    """

    def __init__(self, size: np.ndarray) -> None:
        self._low = np.array([-size[0] / 2, 0.0, -size[2] / 2])
        shape = np.ceil(np.asarray(size) / CELL).astype(int) + 1
        self._cells = np.zeros(tuple(shape), dtype=np.bool_)

    def fits(self, points: np.ndarray, lift: float = 0.02) -> bool:
        """Test whether surface points (N, 3) (room, metres) lie in free voxels inside the room.

        Points lower than `lift` above the lowest are left out: they touch what they stand on.
        """
        low = float(points[:, 1].min()) + lift
        return bool(_free(self._cells, self._low, points.astype(np.float64), low))

    def add(self, points: np.ndarray) -> None:
        """Mark the voxels of surface points (N, 3), in the room's frame."""
        _mark(self._cells, self._low, points.astype(np.float64))

    def clearance(self, point: np.ndarray, most: float) -> float:
        """Measure the free height (metres, at most `most`) over a place (3,)."""
        cell = np.floor((point - self._low) / CELL).astype(int)
        if (cell < 0).any() or (cell >= self._cells.shape).any():
            return 0.0
        column = self._cells[cell[0], cell[1] + 1 : cell[1] + 1 + int(most / CELL), cell[2]]
        taken = np.flatnonzero(column)
        return float(taken[0] * CELL) if len(taken) else most

    def free_floor(self, low: float, high: float) -> np.ndarray:
        """Return places (N, 2) (x, z) on the floor, free between two heights and 30 cm around."""
        first, last = int(low / CELL), int(high / CELL)
        taken = self._cells[:, first:last].any(axis=1)
        reach = 2 * int(0.3 / CELL) + 1
        places = np.argwhere(~ndimage.maximum_filter(taken, size=reach, mode="constant", cval=1))
        return np.asarray(places * CELL + CELL / 2 + self._low[[0, 2]])


def surface_points(mesh: Mesh, spacing: float = 0.03) -> np.ndarray:
    """Spread points over a mesh's surface (V, F in metres) on a regular pattern, no farther apart than `spacing`."""
    return np.asarray(_spread(mesh.vertices.astype(np.float64), mesh.faces.astype(np.int64), spacing))


@numba.njit(cache=True)
@no_type_check
def _spread(vertices, faces, spacing):
    total = 0
    steps = np.zeros(len(faces), np.int64)
    for f in range(len(faces)):
        a, b, c = vertices[faces[f, 0]], vertices[faces[f, 1]], vertices[faces[f, 2]]
        longest = max(np.linalg.norm(b - a), np.linalg.norm(c - a), np.linalg.norm(c - b))
        steps[f] = min(400, int(np.ceil(longest / spacing)) + 1)
        total += (steps[f] + 1) * (steps[f] + 2) // 2
    found = np.empty((total, 3))
    at = 0
    for f in range(len(faces)):
        a, b, c = vertices[faces[f, 0]], vertices[faces[f, 1]], vertices[faces[f, 2]]
        n = steps[f]
        for i in range(n + 1):
            for j in range(n + 1 - i):
                u, v = i / n, j / n
                for k in range(3):
                    found[at, k] = a[k] + u * (b[k] - a[k]) + v * (c[k] - a[k])
                at += 1
    return found


@numba.njit(cache=True)
@no_type_check
def _free(cells, low, points, above):
    for n in range(len(points)):
        i = int(np.floor((points[n, 0] - low[0]) / CELL))
        j = int(np.floor((points[n, 1] - low[1]) / CELL))
        k = int(np.floor((points[n, 2] - low[2]) / CELL))
        if i < 0 or k < 0 or i >= cells.shape[0] or k >= cells.shape[2] or j >= cells.shape[1]:
            return False
        if points[n, 1] >= above and j >= 0 and cells[i, j, k]:
            return False
    return True


@numba.njit(cache=True)
@no_type_check
def _mark(cells, low, points):
    for n in range(len(points)):
        i = int(np.floor((points[n, 0] - low[0]) / CELL))
        j = int(np.floor((points[n, 1] - low[1]) / CELL))
        k = int(np.floor((points[n, 2] - low[2]) / CELL))
        if 0 <= i < cells.shape[0] and 0 <= j < cells.shape[1] and 0 <= k < cells.shape[2]:
            cells[i, j, k] = True
