"""Clouds of proposals hold own points and points around, in the frame of the proposal's sides."""

import numpy as np

from kpred.detection.crops import (
    AROUND_POINTS,
    MARGIN,
    OWN_POINTS,
    RoomVoxels,
    plan_frame,
    proposal_crops,
    turned_clouds,
)
from kpred.detection.links import Links
from kpred.detection.networks import CHANNELS, FACTS

LINKS = Links(2, np.array([[0, 1]]), np.array([-6.0]), np.ones((1, 5)))


def room(yaw: float = 0.0) -> RoomVoxels:
    """Two blocks of 500 voxels, 60 cm by 30 cm, 60 cm apart, on a floor; turned by `yaw`."""
    rng = np.random.default_rng(0)
    blocks = [rng.uniform(0, 0.3, (500, 3)) * [2, 1, 1] + [x, 1.0, 0.1] for x in (0.0, 1.2)]
    floor = rng.uniform(-1, 3, (2000, 3)) * [1, 1, 0]
    segment = np.repeat([0, 1, -1], [500, 500, 2000])
    turn = np.array([[np.cos(yaw), -np.sin(yaw), 0], [np.sin(yaw), np.cos(yaw), 0], [0, 0, 1]])
    normals = np.tile([1.0, 0.0, 0.0], (3000, 1))
    return RoomVoxels(np.concatenate([*blocks, floor]) @ turn.T, normals @ turn.T, segment < 0, segment, 0.02)


def test_own_points_are_the_proposals_and_the_others_lie_around_it() -> None:
    clouds, facts = proposal_crops(room(), LINKS, [frozenset({1})])
    assert clouds.shape == (1, OWN_POINTS + AROUND_POINTS, CHANNELS)
    assert facts.shape == (1, FACTS)
    own, around = clouds[0, :OWN_POINTS], clouds[0, OWN_POINTS:]
    assert (own[:, 3] == 1).all()
    assert (np.abs(own[:, :2]) <= [0.32, 0.17]).all()
    assert (around[:, 3] == 0).all()
    assert (around[:, 4] == 1).all()
    assert np.abs(around[:, :2]).max() <= 0.32 + MARGIN
    assert (around[:, 2] == 0).all()


def test_facts_are_the_sides_and_ends_of_the_proposal() -> None:
    _, facts = proposal_crops(room(), LINKS, [frozenset({0}), frozenset({0, 1})])
    np.testing.assert_allclose(facts[:, 1], [0.6, 1.8], atol=0.1)
    np.testing.assert_allclose(facts[:, 2], [0.3, 0.3], atol=0.08)
    np.testing.assert_allclose(facts[:, 3:5], [[0.1, 0.4], [0.1, 0.4]], atol=0.03)
    alone, both = facts[:, 7:]
    assert alone[1] < -0.9 and alone[2] < -0.9  # The other block is of another object.
    assert both[0] < -0.9 and both[2] == -1.0


def test_turned_rooms_give_equal_clouds() -> None:
    straight, _ = proposal_crops(room(), LINKS, [frozenset({0})])
    for yaw in (0.35, 1.4, -2.0):
        turned, _ = proposal_crops(room(yaw), LINKS, [frozenset({0})])
        own = turned[0, :OWN_POINTS]
        assert (np.ptp(own[:, :2], axis=0) <= [0.67, 0.38]).all(), yaw
        np.testing.assert_allclose(own[:, 7], straight[0, :OWN_POINTS, 7], atol=0.1)


def test_the_frame_is_the_smallest_box() -> None:
    rng = np.random.default_rng(1)
    plan = rng.uniform(-0.5, 0.5, (400, 2)) * [2.0, 0.5]
    turn = np.array([[np.cos(0.6), -np.sin(0.6)], [np.sin(0.6), np.cos(0.6)]])
    rotation, middle, size = plan_frame(plan @ turn.T + [3.0, 1.0])
    np.testing.assert_allclose(middle, [3.0, 1.0], atol=0.06)
    np.testing.assert_allclose(size, [2.0, 0.5], atol=0.2)
    np.testing.assert_allclose(np.abs(rotation @ turn), np.eye(2), atol=0.2)


def test_four_quarter_turns_are_none() -> None:
    clouds, _ = proposal_crops(room(0.3), LINKS, [frozenset({0})])
    np.testing.assert_array_equal(turned_clouds(clouds, 4), clouds)
    quarter = turned_clouds(clouds, 1)
    np.testing.assert_allclose(quarter[:, :, 0], -clouds[:, :, 1])
    np.testing.assert_allclose(quarter[:, :, 7], -clouds[:, :, 7])
    np.testing.assert_array_equal(turned_clouds(quarter, 3), clouds)


def test_equal_seeds_give_equal_clouds() -> None:
    first, second = (proposal_crops(room(), LINKS, [frozenset({0})], seed=3)[0] for _ in range(2))
    np.testing.assert_array_equal(first, second)
