"""Clouds of proposals hold own points and points around, centred in plan."""

import numpy as np

from kpred.detection.crops import AROUND_POINTS, MARGIN, OWN_POINTS, RoomVoxels, proposal_crops
from kpred.detection.networks import CHANNELS


def room() -> RoomVoxels:
    """Two blocks of 500 voxels, 60 cm apart, on a floor."""
    rng = np.random.default_rng(0)
    blocks = [rng.uniform(0, 0.3, (500, 3)) + [x, 1.0, 0.1] for x in (0.0, 0.9)]
    floor = rng.uniform(-1, 3, (2000, 3)) * [1, 1, 0]
    segment = np.repeat([0, 1, -1], [500, 500, 2000])
    return RoomVoxels(np.concatenate([*blocks, floor]), np.zeros(3000), segment < 0, segment, 0.02)


def test_own_points_are_the_proposals_and_the_others_lie_around_it() -> None:
    clouds, amount = proposal_crops(room(), [frozenset({1})])
    assert clouds.shape == (1, OWN_POINTS + AROUND_POINTS, CHANNELS)
    np.testing.assert_allclose(amount, np.log(500))
    own, around = clouds[0, :OWN_POINTS], clouds[0, OWN_POINTS:]
    assert (own[:, 3] == 1).all()
    assert np.abs(own[:, :2]).max() <= 0.16
    assert (around[:, 3] == 0).all()
    assert (around[:, 4] == 1).all()
    assert np.abs(around[:, :2]).max() <= 0.16 + MARGIN
    assert (around[:, 2] == 0).all()


def test_two_pieces_are_one_proposal() -> None:
    clouds, amount = proposal_crops(room(), [frozenset({0, 1})])
    np.testing.assert_allclose(amount, np.log(1000))
    assert np.ptp(clouds[0, :OWN_POINTS, 0]) > 1.0


def test_equal_seeds_give_equal_clouds() -> None:
    first, second = (proposal_crops(room(), [frozenset({0})], seed=3)[0] for _ in range(2))
    np.testing.assert_array_equal(first, second)
