"""Stiffness that keeps the thickness of boards whose scan does not show it, compiled for the CPU."""

from __future__ import annotations

from typing import no_type_check

import numba

FACING = 0.7
"""A point is on a side of a board if its normal has at least this component across it."""

MIN_HELD = 0.05
"""A board that is held less than this is free."""


@numba.njit(cache=True, nogil=True)
@no_type_check
def hold_thickness(normals, bounds, seen, half, thin, blurred, growth, weight, stiff):
    """Add to `stiff` (3, U, U) the squared growth of boards along the axes along which their thickness is not seen.

    It is not seen where one side was not, or where the two sides are nearer to each other than samples are.

    Args:
        normals: (N, 3) of points that are sorted by part; bounds: (C + 1,) first point of each part.
        seen: (N,) how surely each point was seen; half: (C, 3) half sides of the parts.
        thin: largest side of a board's thickness; blurred: thickness up to which the scan's samples hide it.
        growth: (C, 3, U) rows of each part's growth; weight: of the squares.
    """
    for part in range(len(bounds) - 1):
        for axis in range(3):
            side = 2.0 * half[part, axis]
            if side >= thin:
                continue
            held = max(
                1.0 - _shown(normals, bounds[part], bounds[part + 1], seen, axis),
                min(max(2.0 - side / max(blurred, 1e-9), 0.0), 1.0),
            )
            if held > MIN_HELD:
                row = growth[part, axis]
                for j in range(len(row)):
                    if row[j] != 0.0:
                        for k in range(len(row)):
                            stiff[axis, j, k] += weight * held * row[j] * row[k]


@numba.njit(cache=True, nogil=True)
@no_type_check
def _shown(normals, first, last, seen, axis):
    """Compute how surely the lesser seen of the two sides of a part across an axis was seen."""
    above, below, seen_above, seen_below = 0.0, 0.0, 0.0, 0.0
    for i in range(first, last):
        if normals[i, axis] > FACING:
            above += 1.0
            seen_above += seen[i]
        elif normals[i, axis] < -FACING:
            below += 1.0
            seen_below += seen[i]
    return min(seen_above / max(above, 1e-9), seen_below / max(below, 1e-9))
