"""Where the whole surface of each candidate is expected: where its keypoints put it, about the middle of the unit box.

The unit box is that of the whole object, so that its surface reaches as far to one side of the middle as to the other,
and what was seen far out on one side has its like on the other.
"""

from __future__ import annotations

import numpy as np

from kpred.ops.typing import Float

OUTERMOST = 0.99
"""Fraction of the scan's points that the expected box holds along each axis; others may be strays."""

MIN_REACH = 1e-6
"""Least half side of a box that is stretched, unit box."""


def expected_surfaces(
    deformed: Float[np.ndarray, "candidates points 3"], scan: Float[np.ndarray, "seen 3"]
) -> Float[np.ndarray, "candidates points 3"]:
    """Center each candidate's surface in the unit box and stretch it to what was seen; float32.

    Args:
        deformed: their surfaces, where keypoints put them; scan: of a part of the object, its unit box.
    """
    low, high = deformed.min(axis=1, keepdims=True), deformed.max(axis=1, keepdims=True)
    reach = (high - low) / 2
    seen = np.minimum(np.quantile(np.abs(scan), OUTERMOST, axis=0), 1.0)
    stretch = np.maximum(reach, seen) / np.maximum(reach, MIN_REACH)
    flat = reach < MIN_REACH
    found = (deformed - (low + high) / 2) * np.where(flat, 1.0, stretch)
    return np.ascontiguousarray(found, dtype=np.float32)
