"""Laws of virtual rooms: equal seeds, furniture apart, boxes, labels on their surfaces, points only where seen."""

from __future__ import annotations

import itertools
from collections.abc import Callable
from functools import cache

import numpy as np
import pytest
from scipy.spatial import cKDTree

from kpred.synthetic.rooms.catalogue import Catalogue
from kpred.synthetic.rooms.furnish import furnish_room
from kpred.synthetic.rooms.occupancy import surface_points
from kpred.synthetic.rooms.room import OTHER, STRUCTURE, Room, RoomObject
from kpred.synthetic.rooms.scan import SCANNERS, RoomScan, scan_room

FURNITURE = ("chair", "table", "cabinet")
BIG_OTHERS = ("bed", "sofa_two", "sofa_three")
SPACING, FINE = 0.01, 0.006
"""Metres between points of a surface; fine, where crossings are looked for."""


@pytest.fixture(scope="module")
def rooms() -> list[Room]:
    catalogue = Catalogue(3)
    return [furnish_room(3, index, catalogue) for index in range(5)]


@pytest.fixture(scope="module", params=SCANNERS)
def scanned(request: pytest.FixtureRequest, rooms: list[Room]) -> tuple[Room, RoomScan]:
    return rooms[0], scan_room(rooms[0], request.param, np.random.default_rng(2))


def surface_of(item: RoomObject, spacing: float = SPACING) -> np.ndarray:
    return surface_points(item.mesh, spacing) @ item.pose[:3, :3].T + item.pose[:3, 3]


def test_equal_seeds_give_equal_rooms_whatever_was_made_before(rooms: list[Room]) -> None:
    again = furnish_room(3, 4, Catalogue(3))
    assert [item.name for item in again.objects] == [item.name for item in rooms[4].objects]
    for one, other in zip(again.surfaces(), rooms[4].surfaces(), strict=True):
        np.testing.assert_array_equal(one, other)


def test_other_seeds_give_other_rooms() -> None:
    one, other = (furnish_room(seed, 0, Catalogue(seed)) for seed in (1, 2))
    assert not np.array_equal(one.size, other.size)


def test_every_room_is_furnished(rooms: list[Room]) -> None:
    counts = [sum(item.category in FURNITURE for item in room.objects) for room in rooms]
    assert min(counts) >= 2
    assert np.mean(counts) >= 6
    assert {item.category for room in rooms for item in room.objects} == {*FURNITURE, OTHER, STRUCTURE}


def test_furniture_does_not_interpenetrate(rooms: list[Room]) -> None:
    for room in rooms:
        big = [item for item in room.objects if item.category in FURNITURE or item.name in BIG_OTHERS]
        surface = cache(lambda number, big=big: surface_of(big[number], FINE))
        for i, j in itertools.combinations(range(len(big)), 2):
            one, other = big[i], big[j]
            assert not _holds(one, other), (one.name, other.name)
            assert not _holds(other, one), (one.name, other.name)
            low, high = _overlap(one, other)
            if (low < high).all():
                assert not _cross(surface(i), surface(j), low, high), (one.name, other.name)


def test_crossing_furniture_would_be_noticed(rooms: list[Room]) -> None:
    chair = next(item for item in rooms[1].objects if item.category == "chair")
    moved = chair.pose.copy()
    moved[:3, 3] += moved[:3, 0] * 0.5 * np.ptp(chair.box[:, 0])
    other = RoomObject("moved", "chair", chair.mesh, moved)
    assert _cross(surface_of(chair, FINE), surface_of(other, FINE), *_overlap(chair, other))


def _overlap(one: RoomObject, other: RoomObject) -> tuple[np.ndarray, np.ndarray]:
    """Lower and upper corner of what the boxes of two placed objects share; surfaces cross nowhere else."""
    ends = [item.placed_vertices() for item in (one, other)]
    low = np.max([vertices.min(axis=0) for vertices in ends], axis=0)
    return low, np.min([vertices.max(axis=0) for vertices in ends], axis=0)


def _cross(one: np.ndarray, other: np.ndarray, low: np.ndarray, high: np.ndarray) -> bool:
    """Whether surfaces cross in a box: then points of both lie together there; what touches lies a little apart."""
    a, b = (cloud[((cloud >= low) & (cloud <= high)).all(axis=1)] for cloud in (one, other))
    if not len(a) or not len(b):
        return False
    distance, _ = cKDTree(a).query(b, distance_upper_bound=0.01)
    return bool((distance < 0.004).sum() >= 5)


def _holds(one: RoomObject, other: RoomObject) -> bool:
    """Whether the box of one holds the box of the other."""
    if one.category == "table":
        return False
    corners = np.stack(np.meshgrid(*other.box.T, indexing="ij"), axis=-1).reshape(-1, 3)
    placed = corners @ other.pose[:3, :3].T + other.pose[:3, 3]
    local = (placed - one.pose[:3, 3]) @ one.pose[:3, :3]
    low, high = one.box
    return bool(((local >= low - 1e-6) & (local <= high + 1e-6)).all())


def test_furniture_stands_in_the_room_and_poses_are_rigid(rooms: list[Room]) -> None:
    for room in rooms:
        for item in room.objects:
            rotation = item.pose[:3, :3]
            np.testing.assert_allclose(rotation @ rotation.T, np.eye(3), atol=1e-9)
            assert np.linalg.det(rotation) == pytest.approx(1.0)
            if item.category in FURNITURE:
                placed = item.placed_vertices()
                assert (np.abs(placed[:, [0, 2]]) <= room.size[[0, 2]] / 2 + 0.05).all()
                assert placed[:, 1].min() > -1e-3
                assert placed[:, 1].max() < room.size[1] + 0.05


def test_boxes_contain_their_meshes(rooms: list[Room]) -> None:
    for item in rooms[1].objects:
        local = (item.placed_vertices() - item.pose[:3, 3]) @ item.pose[:3, :3]
        assert (local >= item.box[0] - 1e-6).all()
        assert (local <= item.box[1] + 1e-6).all()


def test_equal_seeds_give_equal_scans(rooms: list[Room]) -> None:
    one, other = (scan_room(rooms[2], "mesh", np.random.default_rng(5)) for _ in range(2))
    np.testing.assert_array_equal(one.points, other.points)
    np.testing.assert_array_equal(one.instance, other.instance)


@pytest.fixture(scope="module")
def trees(rooms: list[Room]) -> Callable[[int], cKDTree]:
    """The surface of each object of the first room, for all scanners."""
    return cache(lambda number: cKDTree(surface_of(rooms[0].objects[number], 0.02)))


def test_labelled_points_lie_on_their_objects(scanned: tuple[Room, RoomScan], trees: Callable[[int], cKDTree]) -> None:
    room, scan = scanned
    assert len(scan.points) > 5000
    assert scan.instance.min() >= -1
    assert scan.instance.max() < len(room.objects)
    distances = [
        trees(number).query(scan.points[scan.instance == number])[0]
        for number in np.unique(scan.instance[scan.instance >= 0])
    ]
    found = np.concatenate(distances)
    assert np.quantile(found, 0.5) < 0.025
    assert np.quantile(found, 0.98) < 0.08
    assert found.max() < scan.deviation + 0.02


def test_points_lie_only_where_a_camera_sees(scanned: tuple[Room, RoomScan]) -> None:
    _, scan = scanned
    own = scan.points[scan.instance >= 0]
    seen = scan.views.sees(own, np.full(len(own), 0.03 + scan.deviation / 2))
    assert seen.mean() > 0.995


def test_hidden_places_are_not_seen(rooms: list[Room]) -> None:
    scan = scan_room(rooms[0], "view", np.random.default_rng(2))
    eye = scan.views.poses[0, :3, 3]
    own = scan.points[scan.instance >= 0].astype(float)
    ray = (own - eye) / np.linalg.norm(own - eye, axis=1, keepdims=True)
    before, behind = own - 0.2 * ray, own + 0.3 * ray
    tolerance = np.full(len(own), 0.02)
    assert scan.views.sees(before, tolerance).mean() > 0.95
    assert scan.views.sees(behind, tolerance).mean() < 0.1


def test_a_single_view_is_never_empty(rooms: list[Room]) -> None:
    for seed in range(20):
        scan = scan_room(rooms[seed % len(rooms)], "view", np.random.default_rng(seed))
        assert len(scan.points) > 5000, seed


def test_one_view_shows_less_than_a_scan_by_hand(rooms: list[Room]) -> None:
    room = rooms[0]
    surface = np.concatenate([surface_of(item, 0.05) for item in room.objects if item.category in FURNITURE])
    share = {
        kind: scan_room(room, kind, np.random.default_rng(4)).views.sees(surface, np.full(len(surface), 0.03)).mean()
        for kind in ("view", "mesh")
    }
    assert share["view"] < share["mesh"] < 0.95
