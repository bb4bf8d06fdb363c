"""Columns of the structure-keeping maps compiled for the CPU: a quadratic B-spline, its chords, and the parts' own."""

from __future__ import annotations

from typing import no_type_check

import numba
import numpy as np


@numba.njit(cache=True, nogil=True)
@no_type_check
def spline_weights(place, low, high, weights):
    """Fill `weights` (K,) of a uniform quadratic B-spline's controls; outside the range its end pieces go on."""
    cells = len(weights) - 2
    at = (place - low) / max(high - low, 1e-9) * cells
    cell = min(max(np.floor(at), 0.0), cells - 1.0)
    fraction, first = at - cell, int(cell)
    weights[:] = 0.0
    weights[first] = (1.0 - fraction) ** 2 / 2.0
    weights[first + 1] = 0.5 + fraction - fraction * fraction
    weights[first + 2] = fraction * fraction / 2.0


@numba.njit(cache=True, nogil=True)
@no_type_check
def _affine_weights(place, part, axis, low, high, ranges, weights, before, after):
    """Fill `weights` (K,) as `spline_weights`; within an affine range of the part they are those of its chord.

    Args:
        ranges: (R, 4) part, axis, first and last place; the last one that holds the place counts.
        before, after: (K,) of memory.
    """
    spline_weights(place, low, high, weights)
    for row in range(len(ranges) - 1, -1, -1):
        first, last = ranges[row, 2], ranges[row, 3]
        if ranges[row, 0] != part or ranges[row, 1] != axis or not (first <= place <= last) or last <= first:
            continue
        spline_weights(first, low, high, before)
        spline_weights(last, low, high, after)
        fraction = (place - first) / (last - first)
        for k in range(len(weights)):
            weights[k] = (1.0 - fraction) * before[k] + fraction * after[k]
        return


@numba.njit(cache=True, nogil=True)
@no_type_check
def fill_spline(points, parts, low, high, ranges, found):
    """Fill `found` (3, N, K) with the weights of the controls at points (N, 3) of the given parts."""
    before, after = np.empty(found.shape[2]), np.empty(found.shape[2])
    for axis in range(3):
        for i in range(len(points)):
            _affine_weights(
                points[i, axis], parts[i], axis, low[axis], high[axis], ranges, found[axis, i], before, after
            )


@numba.njit(cache=True, nogil=True)
@no_type_check
def fill_chords(points, parts, low, high, middle, half, ends_only, ranges, found):
    """Fill `found` (3, K, N) float32 as `fill_spline`; a part with vertices at its ends alone follows its chord."""
    controls = found.shape[1]
    weights, before, after = np.empty(controls), np.empty(controls), np.empty(controls)
    ends = np.empty((2, controls))
    for axis in range(3):
        chord = -1
        for i in range(len(points)):
            part = parts[i]
            if not ends_only[part, axis]:
                _affine_weights(points[i, axis], part, axis, low[axis], high[axis], ranges, weights, before, after)
            else:
                start, side = middle[part, axis] - half[part, axis], 2.0 * half[part, axis]
                if chord != part:
                    # Points are mostly sorted by part: the ends of one are computed once.
                    for end in range(2):
                        place = start + end * side
                        _affine_weights(place, part, axis, low[axis], high[axis], ranges, ends[end], before, after)
                    chord = part
                fraction = (points[i, axis] - start) / side
                for k in range(controls):
                    weights[k] = (1.0 - fraction) * ends[0, k] + fraction * ends[1, k]
            for k in range(controls):
                found[axis, k, i] = weights[k]


@numba.njit(cache=True, nogil=True)
@no_type_check
def fill_own(points, parts, middle, half, sign, lean_axis, found):
    """Fill `found` (3, 4, N) float32: 1, place in the part's box, place along its lean axis, and the bend by that."""
    local = np.empty(3)
    for i in range(len(points)):
        part = parts[i]
        for axis in range(3):
            local[axis] = (points[i, axis] - middle[part, axis]) / half[part, axis]
        local[0] *= sign[part]
        for axis in range(3):
            # Along x, parts that mirror each other move against each other.
            direction = sign[part] if axis == 0 else 1.0
            along = local[lean_axis[part, axis]]
            found[axis, 0, i] = direction
            found[axis, 1, i] = direction * local[axis]
            found[axis, 2, i] = direction * along
            found[axis, 3, i] = direction * (along * along - 1.0 / 3.0)
