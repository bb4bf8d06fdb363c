"""Objects stand on the floor: whether a scan shows their feet, and results that reach down to it where it does not."""

from __future__ import annotations

import numpy as np

from kpred.fitting.upright import UP_AXES
from kpred.ops.typing import Float

LEAST_LEG = 0.05
"""The part that may be stretched or cut is at least this share of the height above the floor."""

MOST_GAP = 0.15
"""A scan that ends higher above the floor than this share of the object's height above it does not show the feet."""


def feet_missing(scan: Float[np.ndarray, "scan 3"], up: str, floor: float) -> bool:
    """Whether the scan of an object that stands on the floor ends well above it, so that parts of it are missing.

    Args:
        scan: in any unit; up: its up axis, one of x, y, z, -x, -y, -z; floor: height of the floor along it.
    """
    height = scan @ np.array(UP_AXES[up], dtype=np.float64)
    low, high = np.quantile(height, [0.01, 0.99])
    return bool(low - floor > MOST_GAP * (high - floor) > 0)


def stood_on(
    points: Float[np.ndarray, "points 3"],
    lowest: float,
    scan: Float[np.ndarray, "scan 3"],
    up: Float[np.ndarray, "3"],
    floor: float,
) -> Float[np.ndarray, "points 3"]:
    """Points of a result with all that is below the scan stretched or cut, along the up axis, to end on the floor.

    What the scan shows stays as it is. A result that ends above the scan's lowest points stays as it is as well.

    Args:
        points: of the result, such as the vertices of its mesh; lowest: height of its lowest point along `up`.
        scan: the scan of the object, in the same frame and unit.
        up: unit vector.
        floor: height of the floor along `up`.
    """
    height = points @ up
    seen = scan @ up
    hinge = max(float(np.quantile(seen, 0.01)), floor + LEAST_LEG * (float(seen.max()) - floor))
    if not floor < hinge or not lowest < hinge:
        return points
    moved = hinge - (hinge - height) * (hinge - floor) / (hinge - lowest)
    return points + np.where(height < hinge, moved - height, 0.0)[:, None] * up
