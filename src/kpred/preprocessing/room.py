"""Rooms that were given as the scan of one object."""

from __future__ import annotations

import numpy as np

from kpred.ops.rotations import upright_rotation
from kpred.ops.typing import Float

MIN_LONG, MIN_WIDE, MIN_HIGH, MAX_LONG = 3.2, 2.2, 1.2, 60.0
"""Sides of a room, metres: the longest, the other along the floor, the height; no furniture has all of them."""

LONGEST_OBJECT = 4000.0
"""Numbers beyond are millimetres of something longer than furniture."""

CELLS, COVERED = 8, 0.5
"""Cells along each side of the floor plan, and the fraction of them in which a room has points."""

EDGE = 0.01
"""Fraction of the points at each end that are left out, as strays."""

ROOM_SENTENCE = (
    "The scan looks like a room, not like one object: cut the object out, or fit all of them with kpred scene."
)


def looks_like_room(points: Float[np.ndarray, "points 3"], up: str, metres: float | None = None) -> bool:
    """Find out whether a scan is plainly a room: larger than furniture in all directions, with a floor plan.

    Args:
        points: in the scan's frame and unit; up: its up axis.
        metres: length of the unit; None where it is not known, and metres or millimetres are tried.
    """
    low, high = np.quantile(points, [EDGE, 1 - EDGE], axis=0)
    size = np.abs(upright_rotation(up) @ (high - low))
    longest = float(size.max())
    factor = metres if metres is not None else 0.001 if longest > LONGEST_OBJECT else 1.0
    sides = size[[0, 2]] * factor
    is_large = sides.max() >= MIN_LONG and sides.min() >= MIN_WIDE and size[1] * factor >= MIN_HIGH
    if not is_large or longest * factor > MAX_LONG:
        return False
    turned = points @ upright_rotation(up).T
    plan = turned[:, [0, 2]]
    ends = np.quantile(plan, [EDGE, 1 - EDGE], axis=0)
    cells = np.floor(CELLS * (plan - ends[0]) / (ends[1] - ends[0])).astype(int)
    inside = ((cells >= 0) & (cells < CELLS)).all(axis=1)
    return len(np.unique(cells[inside] @ [1, CELLS])) >= COVERED * CELLS**2
