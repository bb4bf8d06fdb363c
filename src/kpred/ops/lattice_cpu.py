"""Compiled weights of a lattice's control points at points that are carried by the faces of a mesh."""

from __future__ import annotations

from typing import no_type_check

import numba
import numpy as np

from kpred.ops.typing import Float, Int


def carried_lattice_weights(
    vertices: Float[np.ndarray, "vertices 3"],
    corners: Int[np.ndarray, "points 3"],
    shares: Float[np.ndarray, "points 3"],
    low: Float[np.ndarray, "3"],
    high: Float[np.ndarray, "3"],
    *,
    size: int,
) -> Float[np.ndarray, "points controls"]:
    """What `kpred.ops.lattice.lattice_weights` says at the corners of each point's face, by their shares in the point.

    Args:
        vertices, corners, shares: as in `kpred.fitting.surface_points.SurfacePoints`, float32 and int64.
        low, high: of the lattice's box, in the vertices' frame; size: control points along each axis.
    """
    weights = np.zeros((len(corners), size**3), np.float32)
    _carry(vertices, corners, shares, low.astype(np.float32), high.astype(np.float32), size, weights)
    return weights


@numba.njit(cache=True, nogil=True)
@no_type_check
def _carry(vertices, corners, shares, low, high, size, weights):
    cells = size - 2
    scale = np.empty(3, np.float32)
    for axis in range(3):
        scale[axis] = cells / max(high[axis] - low[axis], np.float32(1e-3))
    piece = np.empty((3, 3), np.float32)
    cell = np.empty(3, np.int64)
    for p in range(len(corners)):
        for corner in range(3):
            share = shares[p, corner]
            for axis in range(3):
                place = (vertices[corners[p, corner], axis] - low[axis]) * scale[axis]
                cell[axis] = min(max(int(np.floor(place)), 0), cells - 1)
                f = place - np.float32(cell[axis])
                half = np.float32(0.5)
                piece[axis, 0] = half * (1 - f) * (1 - f)
                piece[axis, 1] = half + f - f * f
                piece[axis, 2] = half * f * f
            for i in range(3):
                for j in range(3):
                    along = share * piece[0, i] * piece[1, j]
                    start = ((cell[0] + i) * size + cell[1] + j) * size + cell[2]
                    for k in range(3):
                        weights[p, start + k] += along * piece[2, k]
