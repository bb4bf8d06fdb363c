"""Objects stand on the floor: whether a scan shows their feet."""

from __future__ import annotations

import numpy as np

from kpred.ops.rotations import UP_AXES
from kpred.ops.typing import Float

MAX_GAP = 0.15
"""A scan that ends higher above the floor than this fraction of the object's height above it lacks the feet."""


def is_truncated(scan: Float[np.ndarray, "scan 3"], up: str, floor: float) -> bool:
    """Decide whether the scan of an object that stands on the floor ends well above it.

    Args:
        scan: in any unit; up: its up axis, one of x, y, z, -x, -y, -z; floor: height of the floor along it.
    """
    height = scan @ np.array(UP_AXES[up], dtype=np.float64)
    low, high = np.quantile(height, [0.01, 0.99])
    return bool(low - floor > MAX_GAP * (high - floor) > 0)
