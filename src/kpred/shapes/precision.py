"""What single precision does to coordinates far from the origin."""

from __future__ import annotations

import numpy as np

from kpred.ops.typing import Float


def single_precision_step(points: Float[np.ndarray, "points 3"]) -> float:
    """Return the largest float32 spacing at the coordinates (N, 3), in their unit."""
    largest = float(np.abs(points).max(initial=0.0))
    return float(np.spacing(np.float32(min(largest, 1e38))))


def needs_double(points: Float[np.ndarray, "points 3"], tolerance: float) -> bool:
    """Test whether float32 moves points (N, 3) by more than `tolerance` of their extent."""
    if not len(points):
        return False
    extent = float((points.max(axis=0) - points.min(axis=0)).max())
    return single_precision_step(points) > 2 * tolerance * extent
