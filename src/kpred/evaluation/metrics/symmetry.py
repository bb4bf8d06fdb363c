"""Turns about the vertical that leave a shape as it is, and yaw errors that do not count them.

The law: a surface is symmetric under a turn about the vertical axis through the middle of its box if it and its turned
copy lie on average less than `TOLERANCE` from each other (both ways), and of neither more than `STRAY_FRACTION` is
farther than `STRAY_DISTANCE`: a shelf's missing front is a small part of its surface, and yet front and back differ.
Distances are fractions of the longer horizontal side, since height does not make a turn smaller.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.spatial import cKDTree

from kpred.ops.typing import Float

TOLERANCE = 0.02
STRAY_DISTANCE = 0.05
STRAY_FRACTION = 0.05

STEP_DEGREES = 15
"""A shape that all multiples of this turn leave as it is counts as round."""

_QUERIED = 2048


@dataclass(frozen=True)
class Symmetry:
    """A group of turns about the vertical.

    Attributes:
        name: how people call it.
        step: degrees; the turns are its multiples. 360: no turn but the whole one; 0: every turn.
    """

    name: str
    step: float


NONE = Symmetry("none", 360.0)
HALF_TURN = Symmetry("half turn", 180.0)
QUARTER_TURN = Symmetry("quarter turn", 90.0)
ROUND = Symmetry("round", 0.0)
SYMMETRIES = (NONE, HALF_TURN, QUARTER_TURN, ROUND)

OF_SCAN2CAD = {"__SYM_ROTATE_UP_2": HALF_TURN, "__SYM_ROTATE_UP_4": QUARTER_TURN, "__SYM_ROTATE_UP_INF": ROUND}
"""Scan2CAD's classes; all others are none."""


def vertical_symmetry(surface: Float[np.ndarray, "points 3"]) -> Symmetry:
    """Find the largest group of `SYMMETRIES` whose rotations all map a surface onto itself.

    Args:
        surface: points spread evenly over the whole surface, in random order, y up, any unit. Take 8192 of them: what
            their spacing adds to distances is taken off, but hides smaller differences.
    """
    points = np.asarray(surface, dtype=np.float64)
    low, high = points.min(axis=0), points.max(axis=0)
    side = float(max(high[0] - low[0], high[2] - low[2]))
    if side <= 0:
        return ROUND
    centred = (points - (low + high) / 2) / side
    tree = cKDTree(centred)
    queries = centred[:_QUERIED]
    spacing = float(tree.query(queries, k=2)[0][:, 1].mean())

    def same(degrees: float) -> bool:
        # The way back, from the surface to its turned copy, is the way of the opposite turn.
        ways = [tree.query(turned(queries, way))[0] for way in (degrees, -degrees)]
        stray = max(float((way > max(STRAY_DISTANCE, 3 * spacing)).mean()) for way in ways)
        # A copy that lies a little off the surface is a little off and as far along it as samples are apart.
        off = max(float(np.mean(ways)) ** 2 - spacing**2, 0.0) ** 0.5
        return off < TOLERANCE and stray <= STRAY_FRACTION

    if not same(180.0):
        return NONE
    if not same(90.0):
        return HALF_TURN
    rest = (float(degrees) for degrees in range(STEP_DEGREES, 180, STEP_DEGREES) if degrees != 90)
    return ROUND if all(same(degrees) for degrees in rest) else QUARTER_TURN


def turned(points: Float[np.ndarray, "points 3"], degrees: float) -> Float[np.ndarray, "points 3"]:
    """Rotate points about +y through the origin; +z goes towards +x."""
    c, s = np.cos(np.radians(degrees)), np.sin(np.radians(degrees))
    return np.stack([c * points[:, 0] + s * points[:, 2], points[:, 1], c * points[:, 2] - s * points[:, 0]], axis=1)


def yaw_between(found: Float[np.ndarray, "3 3"], true: Float[np.ndarray, "3 3"]) -> float:
    """Degrees in (-180, 180] by which one rotation (outside -> canonical axes) turns a thing farther than another.

    Where they tilt differently, it is the turn about the canonical up axis (+y) that comes nearest to the difference.
    """
    difference = found @ true.T
    return float(np.degrees(np.arctan2(difference[0, 2] - difference[2, 0], difference[0, 0] + difference[2, 2])))


def yaw_error(degrees: float, symmetry: Symmetry) -> float:
    """Reduce a rotation to [0, 180] degrees by the nearest rotation of a symmetry."""
    if symmetry.step == 0:
        return 0.0
    rest = degrees % symmetry.step
    return float(min(rest, symmetry.step - rest))
