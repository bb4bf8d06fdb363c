"""Mean distances between a scan and a result, and the size of a cloud, compiled for the CPU: one call a candidate."""

from __future__ import annotations

from typing import no_type_check

import numba

from kpred.ops.nearest_cpu import nearest_of_one


@numba.njit(cache=True, nogil=True)
@no_type_check
def mean_distances(goal, result, visible, step, stray):
    """Compute mean squared distances between clouds (M, 3) and (N, 3), float32, by every `step`-th point of each.

    Args:
        visible: (N,) weight of each point of the result; stray: largest squared distance of the bounded means.

    Returns:
        From the scan to the result, bounded and not; from the result to the scan, weighted, bounded and not; and the
        mean weight of all points.
    """
    squared, _ = nearest_of_one(goal[::step].copy(), result)
    forth, forth_bounded = 0.0, 0.0
    for i in range(len(squared)):
        forth += squared[i]
        forth_bounded += min(squared[i], stray)
    squared_back, _ = nearest_of_one(result[::step].copy(), goal)
    back, back_bounded, seen = 0.0, 0.0, 0.0
    for i in range(len(squared_back)):
        back += visible[i * step] * squared_back[i]
        back_bounded += visible[i * step] * min(squared_back[i], stray)
    for i in range(len(visible)):
        seen += visible[i]
    count, count_back = len(squared), len(squared_back)
    return forth / count, forth_bounded / count, back / count_back, back_bounded / count_back, seen / len(visible)


@numba.njit(cache=True, nogil=True)
@no_type_check
def squared_diagonal(points):
    """Compute the squared diagonal of the box of points (N, 3)."""
    total = 0.0
    for axis in range(3):
        low = high = points[0, axis]
        for i in range(len(points)):
            low, high = min(low, points[i, axis]), max(high, points[i, axis])
        total += (high - low) * (high - low)
    return total
