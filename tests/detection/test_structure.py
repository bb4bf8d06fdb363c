"""Floor, walls and ceiling are taken from a room; furniture stays."""

import numpy as np

from kpred.detection.structure import find_structure

Room = tuple[np.ndarray, np.ndarray]


def test_floor_and_walls_are_found_and_furniture_is_not(furnished_room: Room) -> None:
    found = find_structure(furnished_room[0][::3])
    owner = furnished_room[1][::3]
    assert found.found
    np.testing.assert_allclose(found.plane, 0.0, atol=0.01)
    assert found.mask[owner < 0].mean() > 0.97
    for row in range(3):
        assert found.mask[owner == row].mean() < 0.2


def test_a_sloping_floor_is_level_in_its_heights(empty_room: np.ndarray) -> None:
    points = empty_room[::3].copy()
    slope = np.array([0.02, -0.01])
    points[:, 2] += points[:, :2] @ slope + 3.0
    found = find_structure(points)
    np.testing.assert_allclose(found.plane, [*slope, 3.0], atol=0.01)
    assert np.abs(found.height[:3000]).max() < 0.03


def test_a_ceiling_is_removed_with_what_lies_above(furnished_room: Room) -> None:
    rng = np.random.default_rng(1)
    ceiling = np.column_stack([rng.uniform(-2.5, 2.5, 6000), rng.uniform(-2, 2, 6000), np.full(6000, 2.5)])
    lamp = rng.normal([0, 0, 2.6], 0.02, (100, 3))
    points = np.concatenate([furnished_room[0][::3], ceiling, lamp])
    found = find_structure(points)
    assert found.mask[-6100:].mean() > 0.98


def test_without_a_floor_the_lowest_points_are_the_level(empty_room: np.ndarray) -> None:
    found = find_structure(empty_room[empty_room[:, 2] > 0.1][::2] + [0, 0, 5])
    assert not found.found
    assert abs(found.plane[2] - 5.1) < 0.02
    assert found.mask.mean() > 0.9


def test_the_inner_walls_of_a_room_that_is_no_rectangle_are_walls(empty_room: np.ndarray) -> None:
    points = empty_room[::3]
    points = points[(points[:, 0] < 1.0) | (points[:, 1] < 0.0)]
    rng = np.random.default_rng(2)
    one = np.column_stack([np.full(3000, 1.0), rng.uniform(0, 2, 3000), rng.uniform(0, 2.4, 3000)])
    other = np.column_stack([rng.uniform(1, 2.5, 3000), np.zeros(3000), rng.uniform(0, 2.4, 3000)])
    walls = np.concatenate([one, other]) + rng.normal(0.0, 0.002, (6000, 3))
    found = find_structure(np.concatenate([points, walls]))
    assert found.mask[-6000:].mean() > 0.9


def test_walls_are_seen_by_their_lower_parts_alone(furnished_room: Room) -> None:
    points, owner = furnished_room[0][::3], furnished_room[1][::3]
    low = (points[:, 2] < 1.4) | (owner >= 0)
    lamp = np.random.default_rng(3).uniform([0.9, -0.1, 0.0], [1.1, 0.1, 2.1], (1500, 3))
    found = find_structure(np.concatenate([points[low], lamp]))
    mask = found.mask[:-1500]
    assert mask[owner[low] < 0].mean() > 0.95
    assert found.mask[-1500:].mean() < 0.1
    for row in range(3):
        assert mask[owner[low] == row].mean() < 0.2
