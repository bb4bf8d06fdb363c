"""Whether a scan that stands on a known floor lacks its feet."""

import numpy as np
import pytest

from kpred.fitting.floor_contact import is_truncated

UPS = {"z": np.array([0.0, 0.0, 1.0]), "-y": np.array([0.0, -1.0, 0.0])}


def frame(up: np.ndarray) -> np.ndarray:
    """Rows of points times this: z of the points becomes the direction `up`."""
    side = np.cross(up, [0.0, 1.0, 0.0] if abs(up[1]) < 0.9 else [1.0, 0.0, 0.0])
    side /= np.linalg.norm(side)
    return np.stack([side, np.cross(up, side), up])


@pytest.mark.parametrize("up", ["z", "-y"])
@pytest.mark.parametrize(("floor", "missing"), [(0.5, False), (0.42, False), (0.2, True), (-1.0, True), (2.0, False)])
def test_a_scan_that_ends_well_above_the_floor_lacks_the_feet(
    up: str, floor: float, missing: bool, rng: np.random.Generator
) -> None:
    scan = rng.uniform([-1, -1, 0.5], [1, 1, 1.5], (500, 3)) @ frame(UPS[up])
    assert is_truncated(scan, up, floor) == missing
