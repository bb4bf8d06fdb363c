"""Results reach the floor without moving what the scan shows."""

import numpy as np
import pytest

from kpred.fitting.standing import feet_missing, stood_on

UPS = {"z": np.array([0.0, 0.0, 1.0]), "-y": np.array([0.0, -1.0, 0.0]), "leaning": np.array([0.6, 0.0, 0.8])}


def frame(up: np.ndarray) -> np.ndarray:
    """Rows of points times this: z of the points becomes the direction `up`."""
    side = np.cross(up, [0.0, 1.0, 0.0] if abs(up[1]) < 0.9 else [1.0, 0.0, 0.0])
    side /= np.linalg.norm(side)
    return np.stack([side, np.cross(up, side), up])


@pytest.mark.parametrize("up", UPS)
@pytest.mark.parametrize("bottom", [-0.3, 0.4])
def test_legs_that_were_not_scanned_reach_down_to_the_floor(up: str, bottom: float, rng: np.random.Generator) -> None:
    scan = rng.uniform([-1, -1, 0.6], [1, 1, 0.7], (500, 3))
    result = rng.uniform([-1, -1, bottom], [1, 1, 0.7], (400, 3))
    result[0, 2] = bottom
    turn = frame(UPS[up])
    moved = stood_on(result @ turn, bottom, scan @ turn, UPS[up], 0.1) @ turn.T
    assert moved[:, 2].min() == pytest.approx(0.1)
    above = result[:, 2] > 0.6 + 0.1 * 0.02
    np.testing.assert_allclose(moved[above], result[above], atol=1e-12)
    np.testing.assert_allclose(moved[:, :2], result[:, :2], atol=1e-12)
    # Upright order is kept, so that nothing folds over.
    order = np.argsort(result[:, 2])
    assert (np.diff(moved[order, 2]) >= -1e-12).all()


def test_a_result_that_stands_stays_as_it_is(rng: np.random.Generator) -> None:
    scan = rng.uniform([-1, -1, 0.0], [1, 1, 1.0], (500, 3))
    np.testing.assert_allclose(stood_on(scan, 0.0, scan, UPS["z"], 0.0), scan, atol=1e-12)


def test_feet_that_were_scanned_are_moved_no_more_than_to_the_floor(rng: np.random.Generator) -> None:
    scan = rng.uniform([-1, -1, 0.0], [1, 1, 1.0], (2000, 3))
    result = np.vstack([scan, [0.0, 0.0, -0.04]])
    moved = stood_on(result, -0.04, scan, UPS["z"], 0.0)
    assert moved[-1, 2] == pytest.approx(0.0)
    assert np.abs(moved - result).max() <= 0.04 + 1e-12
    np.testing.assert_array_equal(moved[result[:, 2] > 0.06], result[result[:, 2] > 0.06])


@pytest.mark.parametrize(("floor", "lowest"), [(2.0, 0.0), (0.0, 0.9)])
def test_what_makes_no_sense_changes_nothing(floor: float, lowest: float, rng: np.random.Generator) -> None:
    """A floor above the scan; a result that ends above the scan's lowest points."""
    scan = rng.uniform([-1, -1, 0.5], [1, 1, 1.0], (500, 3))
    result = rng.uniform([-1, -1, lowest], [1, 1, 1.0], (50, 3))
    np.testing.assert_array_equal(stood_on(result, lowest, scan, UPS["z"], floor), result)


@pytest.mark.parametrize("up", ["z", "-y"])
@pytest.mark.parametrize(("floor", "missing"), [(0.5, False), (0.42, False), (0.2, True), (-1.0, True), (2.0, False)])
def test_a_scan_that_ends_well_above_the_floor_lacks_the_feet(
    up: str, floor: float, missing: bool, rng: np.random.Generator
) -> None:
    scan = rng.uniform([-1, -1, 0.5], [1, 1, 1.5], (500, 3)) @ frame(UPS[up])
    assert feet_missing(scan, up, floor) == missing
