"""Tops of several metres along a wall with chairs and drawers, and seats side by side."""

import numpy as np

from kpred.synthetic.rooms.arrangement import Arrangement
from kpred.synthetic.rooms.catalogue import Catalogue
from kpred.synthetic.rooms.long_desks import long_desk, waiting_seats
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
