"""Matches between a deformed model and a scan, compiled for the CPU: nearest neighbours both ways, robust weights."""

from __future__ import annotations

from typing import no_type_check

import numba
import numpy as np

from kpred.ops.nearest_cpu import nearest_of_one
from kpred.ops.weighted_sums_cpu import ranked

SEEN = 0.3
"""Surface less visible than this is no match for a point of the scan."""

SHARP = np.float32(3.0)
"""Factor of distances across a surface beside those along it, where the two sides of boards are to be separated."""

MIN_SEEN = 8
"""Where fewer points than this are seen, all are matched."""


@numba.njit(cache=True, nogil=True)
@no_type_check
def seen_points(visible):
    """Rows of the points that points of the scan are matched to."""
    seen, count = np.empty(len(visible), np.int64), 0
    for i in range(len(visible)):
        if visible[i] >= SEEN:
            seen[count] = i
            count += 1
    if count < MIN_SEEN:
        for i in range(len(visible)):
            seen[i] = i
        count = len(visible)
    return seen[:count]


@numba.njit(cache=True, nogil=True)
@no_type_check
def match(moved, facing, sharp, goal, visible, seen, first, robust, minimum, wanted):
    """Fill `wanted` (N, 4): where points should be, times weight, and the weight; both ways.

    Args:
        moved: (N, 3) points of the model; facing: (N,) axis that the surface faces there.
        sharp: whether distances along that axis count `SHARP` times as much, so that each side of a board is matched
            to its own side of the scan.
        goal: (M, 3); visible: (N,); seen: rows that the scan is matched to; first: 0 or 1, every second point from it.
        robust, minimum: see `kpred.refinement.structure_cpu.fit_rounds`.
    """
    wanted[:] = 0
    queries = goal[first::2].copy()
    squared, row = _to_surface(queries, moved, seen, facing, sharp)
    weight = _robust(squared, robust, minimum)
    for i in range(len(queries)):
        w = np.float32(weight[i] / len(queries))
        for axis in range(3):
            wanted[row[i], axis] += w * queries[i, axis]
        wanted[row[i], 3] += w
    asking = np.arange(first, len(moved), 2)
    squared, index = _from_surface(moved, asking, facing, goal, sharp)
    weight = _robust(squared, robust, minimum)
    for i in range(len(asking)):
        w = np.float32(visible[asking[i]] * weight[i] / len(asking))
        for axis in range(3):
            wanted[asking[i], axis] += w * goal[index[i], axis]
        wanted[asking[i], 3] += w


@numba.njit(cache=True, nogil=True)
@no_type_check
def _to_surface(queries, moved, seen, facing, sharp):
    """Squared distances (Q,) and rows of `moved` (N, 3) that are nearest to queries (Q, 3)."""
    if not sharp:
        squared, index = nearest_of_one(queries, moved[seen].copy())
        return squared, seen[index]
    nearest = np.full(len(queries), np.float32(np.inf))
    row = np.zeros(len(queries), np.int64)
    for axis in range(3):
        mine = seen[facing[seen] == axis]
        if len(mine):
            squared, index = nearest_of_one(_stretched(queries, axis), _stretched(moved[mine], axis))
            for i in range(len(queries)):
                if squared[i] < nearest[i]:
                    nearest[i], row[i] = squared[i], mine[index[i]]
    return nearest, row


@numba.njit(cache=True, nogil=True)
@no_type_check
def _from_surface(moved, asking, facing, goal, sharp):
    """Squared distances (Q,) and rows of `goal` (M, 3) that are nearest to the rows `asking` (Q,) of `moved`."""
    if not sharp:
        return nearest_of_one(moved[asking].copy(), goal)
    nearest = np.empty(len(asking), np.float32)
    row = np.empty(len(asking), np.int64)
    for axis in range(3):
        mine = np.flatnonzero(facing[asking] == axis)
        if len(mine):
            squared, index = nearest_of_one(_stretched(moved[asking[mine]], axis), _stretched(goal, axis))
            nearest[mine], row[mine] = squared, index
    return nearest, row


@numba.njit(cache=True, nogil=True)
@no_type_check
def _stretched(points, axis):
    """Copy of points (N, 3), `SHARP` times as long along one axis."""
    found = points.copy()
    found[:, axis] *= SHARP
    return found


@numba.njit(cache=True, nogil=True)
@no_type_check
def _robust(squared, robust, minimum):
    """Weights (Q,) of matches by their squared distances; the median decides what is far. All 1 if `robust` is 0."""
    if robust <= 0 or len(squared) == 0:
        return np.ones(len(squared), np.float32)
    scale = np.float32(ranked(squared.copy(), (len(squared) - 1) // 2) * robust + minimum)
    ratio = scale / (scale + squared)
    return ratio * ratio


@numba.njit(cache=True, nogil=True)
@no_type_check
def hold(wanted, held, start):
    """Add the pull of weight `held` (N,) toward `start` (N, 3) to `wanted` (N, 4)."""
    for i in range(len(held)):
        for axis in range(3):
            wanted[i, axis] += held[i] * start[i, axis]
        wanted[i, 3] += held[i]
