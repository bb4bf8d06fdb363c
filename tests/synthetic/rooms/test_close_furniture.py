"""Tops of several metres along a wall with chairs and drawers, and seats side by side."""

import numpy as np

from kpred.synthetic.rooms.arrangement import Arrangement
from kpred.synthetic.rooms.catalogue import Catalogue
from kpred.synthetic.rooms.close_furniture import built_in, long_desk, waiting_seats
from kpred.synthetic.rooms.groups import shelf_on
from kpred.synthetic.rooms.shell import build_shell

SIZE = np.array([6.0, 2.6, 6.0])


def arrangement(seed: int) -> Arrangement:
    rng = np.random.default_rng(seed)
    shell, walls = build_shell(SIZE, rng)
    return Arrangement(SIZE, walls, shell, Catalogue(3), rng)


def test_a_long_desk_is_longer_than_a_desk_and_has_seats() -> None:
    widths, chairs = [], 0
    for seed in range(4):
        room = arrangement(seed)
        for wall in room.walls:
            long_desk(room, wall, room.draw("office chair"))
        widths += [float(np.ptp(item.box[:, 0])) for item in room.objects if item.category == "table"]
        chairs += sum(item.category == "chair" for item in room.objects)
    assert len(widths) >= 4
    assert min(widths) > 1.75 and max(widths) <= 3.85
    assert chairs >= len(widths)


def test_seats_stand_side_by_side() -> None:
    gaps = []
    for seed in range(4):
        room = arrangement(seed)
        waiting_seats(room, room.walls[0])
        seats = [item for item in room.objects if item.category == "chair"]
        gaps += [
            float(np.linalg.norm(one.pose[:3, 3] - other.pose[:3, 3]))
            for one, other in zip(seats, seats[1:], strict=False)
        ]
    assert len(gaps) >= 3
    assert min(gaps) < 1.5


def test_built_in_cabinets_are_equal_and_touch() -> None:
    found = 0
    for seed in range(6):
        room = arrangement(seed)
        for wall in room.walls:
            before = len(room.objects)
            built_in(room, wall)
            row = room.objects[before:]
            found += len(row)
            for one, other in zip(row, row[1:], strict=False):
                width = float(np.ptp(one.box[:, 0]))
                gap = float(np.linalg.norm(one.pose[:3, 3] - other.pose[:3, 3])) - width
                assert 0.0 < gap < 0.02 or gap > 0.5 * width  # Else one was left out.
                np.testing.assert_allclose(one.box, other.box)
            assert all(float(item.box[1, 1]) > 1.85 for item in row)
    assert found > 12


def test_shelves_stand_on_the_backs_of_desks() -> None:
    found = 0
    for seed in range(12):
        room = arrangement(seed)
        desk = room.against_wall("desk", room.draw("desk"), room.walls[0], 0.0)
        if desk is None:
            continue
        for shelf in shelf_on(room, desk):
            found += 1
            local = np.linalg.inv(desk.pose) @ np.append(shelf.pose[:3, 3], 1.0)
            assert 0.0 < local[1] - np.ptp(desk.box[:, 1]) < 0.02
            assert shelf.category == "cabinet"
            assert np.ptp(shelf.box[:, 0]) <= np.ptp(desk.box[:, 0]) + 1e-3
            assert local[2] - np.ptp(shelf.box[:, 2]) / 2 >= desk.box[0, 2] - 1e-3
    assert found >= 3
