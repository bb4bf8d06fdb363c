"""The up direction of a room is found from floor, walls and furniture, in any orientation and unit."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from kpred.detection.gravity import find_directions, find_gravity, rotation_between

Room = tuple[np.ndarray, np.ndarray]


@pytest.mark.parametrize("degrees", [0.0, 10.0, 27.0])
def test_tilted_rooms_are_levelled(furnished_room: Room, degrees: float) -> None:
    tilt = Rotation.from_rotvec(np.radians(degrees) * np.array([0.8, 0.6, 0.0])).as_matrix()
    found = find_gravity(furnished_room[0] @ tilt.T)
    assert np.degrees(np.arccos(np.clip(found.direction @ tilt @ [0, 0, 1], -1, 1))) < 1.5
    assert found.axis == "z"
    assert found.is_tilted == (degrees > 0)
    np.testing.assert_allclose(found.rotation @ found.direction, [0, 0, 1], atol=1e-9)


def test_a_room_that_lies_on_its_side_stands_up(furnished_room: Room) -> None:
    found = find_gravity(furnished_room[0][:, [1, 2, 0]])
    assert found.axis == "y"
    assert not found.is_tilted


@pytest.mark.parametrize(("factor", "metres"), [(1.0, 1.0), (100.0, 0.01), (1000.0, 0.001)])
def test_the_unit_follows_from_the_height(furnished_room: Room, factor: float, metres: float) -> None:
    assert find_gravity(furnished_room[0] * factor + 1e4).metres == metres


def test_a_unit_that_is_known_is_taken(furnished_room: Room) -> None:
    (found,) = find_directions(furnished_room[0] / 0.3048, metres=0.3048)
    assert found.metres == 0.3048


def test_a_named_axis_is_taken(furnished_room: Room) -> None:
    found = find_gravity(furnished_room[0], "-y")
    assert (found.axis, found.is_tilted) == ("-y", False)


def test_the_smallest_rotation_between_two_directions() -> None:
    start, end = np.array([0.0, 0.6, 0.8]), np.array([0.0, 0.0, 1.0])
    rotation = rotation_between(start, end)
    np.testing.assert_allclose(rotation @ start, end, atol=1e-12)
    np.testing.assert_allclose(rotation @ rotation.T, np.eye(3), atol=1e-12)
    assert np.trace(rotation) == pytest.approx(1 + 2 * 0.8)
