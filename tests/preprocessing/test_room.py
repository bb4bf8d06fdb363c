"""A room given as an object is noticed; furniture of any unit is not taken for one."""

from pathlib import Path

import numpy as np
import pytest

from kpred.ops.rotations import upright_rotation
from kpred.preprocessing.room import looks_like_room
from kpred.shapes import read_scan
from kpred.synthetic.generator import generate


def scan_room(size: tuple[float, float, float]) -> np.ndarray:
    """Floor, two walls and a box in the middle, y up."""
    rng = np.random.default_rng(0)
    floor, wall, other, box = (rng.random((1000, 3)) for _ in range(4))
    floor[:, 1] = wall[:, 0] = other[:, 2] = 0
    return np.concatenate([floor, wall, other, 0.4 + 0.2 * box]) * size


@pytest.mark.parametrize("up", ["y", "z", "-x"])
@pytest.mark.parametrize("scale", [1.0, 1000.0])
def test_a_room_is_noticed(up: str, scale: float) -> None:
    points = scan_room((5, 2.5, 6)) @ upright_rotation(up) * scale + 7
    assert looks_like_room(points, up)
    assert looks_like_room(points, up, 1 / scale)
    assert not looks_like_room(points / 10, up, 1 / scale)


@pytest.mark.parametrize("scale", [1.0, 100.0, 1000.0])
@pytest.mark.parametrize("category", ["chair", "table", "cabinet"])
def test_furniture_is_no_room_whatever_its_unit(category: str, scale: float) -> None:
    for mesh in generate(category, 5, seed=3, splits=False):
        assert not looks_like_room(mesh.vertices * scale, "y")


def test_a_conference_table_is_no_room() -> None:
    assert not looks_like_room(scan_room((6, 0.8, 2.5)), "y")


def test_real_rooms_and_crops_of_them_are_told_apart(shared_data: Path) -> None:
    rooms, crops = (
        sorted((shared_data / "real" / "rooms").glob("*.ply")),
        (shared_data / "real" / "s3dis").glob("*.ply"),
    )
    assert rooms and all(looks_like_room(read_scan(file), "z") for file in rooms)
    assert not any(looks_like_room(read_scan(file), "z") for file in crops)
