"""Trilinear interpolation of values that are known at the nodes of a regular grid over a box."""

from __future__ import annotations

from typing import no_type_check

import numba
import numpy as np

from kpred.ops.typing import Float


def interpolate_grid(
    grid: Float[np.ndarray, "x y z"],
    low: Float[np.ndarray, "3"],
    high: Float[np.ndarray, "3"],
    places: Float[np.ndarray, "places 3"],
) -> Float[np.ndarray, " places"]:
    """Interpolate values (unit of `grid`, single precision) at places (unit of the box) between the grid's nodes.

    The first node of each axis lies at `low`, the last one at `high`. A place outside has the value of the nearest
    place of the box.
    """
    if min(grid.shape) < 2:
        raise ValueError(f"A grid needs two nodes or more along each axis, but is {grid.shape}.")
    values = np.empty(len(places), np.float32)
    extent = np.asarray(high, np.float64) - np.asarray(low, np.float64)
    # A flat box has one value along its flat axis.
    scale = np.where(extent > 0, (np.array(grid.shape) - 1) / np.where(extent > 0, extent, 1.0), 0.0)
    _interpolate(
        np.ascontiguousarray(grid, np.float32),
        np.asarray(low, np.float64),
        scale,
        np.ascontiguousarray(places),
        values,
    )
    return values


@numba.njit(cache=True, nogil=True)
@no_type_check
def _interpolate(grid, low, scale, places, values):
    for i in range(len(places)):
        x0, y0, z0 = 0, 0, 0
        fx, fy, fz = 0.0, 0.0, 0.0
        for axis in range(3):
            last = grid.shape[axis] - 1
            position = min(max((places[i, axis] - low[axis]) * scale[axis], 0.0), float(last))
            node = min(int(position), last - 1)
            if axis == 0:
                x0, fx = node, position - node
            elif axis == 1:
                y0, fy = node, position - node
            else:
                z0, fz = node, position - node
        value = 0.0
        for dx in range(2):
            wx = fx if dx else 1.0 - fx
            for dy in range(2):
                wy = fy if dy else 1.0 - fy
                for dz in range(2):
                    wz = fz if dz else 1.0 - fz
                    value += wx * wy * wz * grid[x0 + dx, y0 + dy, z0 + dz]
        values[i] = value
