"""Matches between a deformed model and a scan, compiled for the CPU: nearest neighbours both ways, robust weights."""

from __future__ import annotations

from typing import no_type_check

import numba
import numpy as np

from kpred.ops.nearest_cpu import nearest_of_one
from kpred.ops.weighted_sums_cpu import ranked

SEEN = 0.3
"""Surface less visible than this is no match for a point of the scan."""

MIN_SEEN = 8
"""Where fewer points than this are seen, all are matched."""


@numba.njit(cache=True, nogil=True)
@no_type_check
def seen_points(visible):
    """Rows of the points that points of the scan are matched to."""
    seen = np.flatnonzero(visible >= SEEN)
    return seen if len(seen) >= MIN_SEEN else np.arange(len(visible))


@numba.njit(cache=True, nogil=True)
@no_type_check
def match(moved, goal, visible, seen, first, robust, minimum, wanted):
    """Fills `wanted` (N, 4): where points should be, times weight, and the weight; both ways."""
    wanted[:] = 0
    queries = goal[first::2].copy()
    targets = moved[seen].copy() if len(seen) < len(moved) else moved
    squared, index = nearest_of_one(queries, targets)
    scale = np.float32(ranked(squared.copy(), (len(squared) - 1) // 2) * robust + minimum)
    for i in range(len(queries)):
        w = np.float32(1.0 / len(queries))
        if robust > 0:
            ratio = scale / (scale + squared[i])
            w *= ratio * ratio
        row = seen[index[i]] if len(seen) < len(moved) else index[i]
        for axis in range(3):
            wanted[row, axis] += w * queries[i, axis]
        wanted[row, 3] += w
    some = moved[first::2].copy()
    squared, index = nearest_of_one(some, goal)
    scale = np.float32(ranked(squared.copy(), (len(squared) - 1) // 2) * robust + minimum)
    for i in range(len(some)):
        row = first + 2 * i
        w = np.float32(visible[row] / len(some))
        if robust > 0:
            ratio = scale / (scale + squared[i])
            w *= ratio * ratio
        for axis in range(3):
            wanted[row, axis] += w * goal[index[i], axis]
        wanted[row, 3] += w


@numba.njit(cache=True, nogil=True)
@no_type_check
def hold(wanted, held, start):
    """Adds the pull of weight `held` (N,) toward `start` (N, 3) to `wanted` (N, 4)."""
    for i in range(len(held)):
        for axis in range(3):
            wanted[i, axis] += held[i] * start[i, axis]
        wanted[i, 3] += held[i]
