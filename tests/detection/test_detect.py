"""Objects of raw rooms: found in any orientation and unit, and bad rooms cost no traceback."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from kpred.detection.detect import Detection, detect_objects

Room = tuple[np.ndarray, np.ndarray]
TILT = Rotation.from_euler("xyz", [20, -15, 70], degrees=True).as_matrix()


def matched(found: Detection, owner: np.ndarray, names: tuple[str, ...] = ("chair", "table", "cabinet")) -> list[str]:
    """List the objects of which a detection of their category covers at least half (IoU)."""
    result = []
    for row, name in enumerate(names):
        for item in found.objects:
            mine = np.zeros(len(owner), dtype=bool)
            mine[item.rows] = True
            true = owner == row
            if item.category == name and (mine & true).sum() > 0.5 * (mine | true).sum():
                result.append(name)
    return result


@pytest.mark.parametrize(
    ("rotation", "factor"),
    [(np.eye(3), 1.0), (TILT, 1.0), (np.eye(3)[[1, 2, 0]], 1000.0)],
    ids=["level", "tilted", "mm"],
)
def test_furniture_is_found(furnished_room: Room, rotation: np.ndarray, factor: float) -> None:
    points, owner = furnished_room
    found = detect_objects(points @ rotation.T * factor)
    assert {"chair", "table"} <= set(matched(found, owner))
    assert found.floor == pytest.approx(0.0, abs=0.03 * factor)
    assert found.structure[owner < 0].mean() > 0.95


def test_no_row_belongs_to_two_objects_or_to_the_floor(furnished_room: Room) -> None:
    found = detect_objects(furnished_room[0], min_score=0.05)
    rows = np.concatenate([item.rows for item in found.objects])
    assert len(rows) == len(set(rows.tolist()))
    assert not found.structure[rows].any()
    scores = [item.score for item in found.objects]
    assert scores == sorted(scores, reverse=True)


def test_rows_that_are_not_finite_are_left_out(furnished_room: Room) -> None:
    points, owner = furnished_room
    holes = points.copy()
    holes[::10] = np.nan
    found = detect_objects(holes)
    assert sorted(matched(found, np.where(np.isnan(holes[:, 0]), -1, owner))) == ["cabinet", "chair", "table"]


def test_a_room_in_feet_is_found_where_the_unit_is_given(furnished_room: Room) -> None:
    points, owner = furnished_room
    found = detect_objects(points / 0.3048, metres=0.3048)
    assert {"chair", "table"} <= set(matched(found, owner))


def test_a_tenth_of_strays_costs_nothing_where_up_is_known(furnished_room: Room) -> None:
    points, owner = furnished_room
    strays = np.random.default_rng(4).uniform([-4, -3.5, -1.5], [4, 3.5, 4], (len(points) // 10, 3))
    found = detect_objects(np.concatenate([points, strays]), "z")
    all_owners = np.append(owner, np.full(len(strays), -1))
    assert sorted(matched(found, all_owners)) == ["cabinet", "chair", "table"]
    assert found.floor == pytest.approx(0.0, abs=0.03)


def test_half_a_room_shows_what_is_in_it(furnished_room: Room) -> None:
    points, owner = furnished_room
    half = points[:, 1] > 0.0
    assert "table" in matched(detect_objects(points[half]), owner[half])


def test_furniture_without_a_floor_is_found(furnished_room: Room) -> None:
    points, owner = furnished_room
    apart = points[:, 2] > 0.1
    assert "chair" in matched(detect_objects(points[apart], "z"), owner[apart])


@pytest.mark.parametrize("count", [0, 1, 63, 200])
def test_nothing_is_found_in_next_to_nothing(count: int) -> None:
    points = np.random.default_rng(0).normal(size=(count, 3))
    assert detect_objects(points).objects == ()
    assert detect_objects(np.zeros((count, 3))).objects == ()


def test_floor_and_walls_alone_have_no_objects(empty_room: np.ndarray) -> None:
    found = detect_objects(empty_room)
    assert found.objects == ()
    assert found.structure.mean() > 0.9
