"""Furniture that stands close: long tops with drawers below, cabinets up to the ceiling, seats side by side."""

from __future__ import annotations

import numpy as np

from kpred.shapes.mesh import Mesh
from kpred.synthetic.chance import between, happens, whole
from kpred.synthetic.rooms.arrangement import Arrangement
from kpred.synthetic.rooms.groups import CLOSE, depth_of, pushed_in, row, width_of
from kpred.synthetic.rooms.room import pose_of
from kpred.synthetic.rooms.shell import Wall


def long_desk(room: Arrangement, wall: Wall, chair: Mesh) -> None:
    """Stand a desk that is stretched to up to 3.8 m against a wall, with chairs and sets of drawers."""
    rng = room.rng
    mesh = room.draw("desk")
    long = min(between(rng, 1.8, 3.8), wall.length - 0.2)
    stretched = mesh.vertices * np.array([long / width_of(mesh), 1.0, 1.0], dtype=np.float32)
    room_left = (wall.length - long) / 2
    middle = between(rng, -1.0, 1.0) * max(room_left, 0.0)
    desk = room.against_wall("desk", Mesh(stretched, mesh.faces, mesh.name), wall, middle, gap=between(rng, 0.0, 0.05))
    if desk is None:
        return
    front = float(desk.box[1, 2])
    drawers = room.draw("nightstand")
    for _ in range(whole(rng, 0, 3)):
        along = between(rng, -0.45, 0.45) * long
        place = pose_of(along, 0.0, front - depth_of(drawers) / 2 - between(rng, 0.0, 0.1), rng.normal(0.0, 0.03))
        room.put("nightstand", drawers, desk.pose @ place)
    for _ in range(whole(rng, 1, 4)):
        edge = np.array([between(rng, -0.45, 0.45) * long, front])
        pushed_in(room, desk, edge, np.array([0.0, 1.0]), chair, "office chair")


def built_in(room: Arrangement, wall: Wall) -> None:
    """Stand equal cabinets of one height, often up to the ceiling, side by side along a part of a wall."""
    rng = room.rng
    mesh = room.draw("tall cabinet")
    own = np.ptp(mesh.vertices, axis=0)
    tall = float(room.size[1]) - 0.02 if happens(rng, 0.5) else between(rng, 1.9, float(room.size[1]) - 0.05)
    size = np.array([between(rng, 0.4, 1.2), tall, between(rng, 0.3, 0.65)])
    shaped = Mesh((mesh.vertices * (size / own)).astype(np.float32), mesh.faces, mesh.name)
    along = between(rng, -0.5, 0.0) * wall.length + size[0] / 2 + 0.02
    for _ in range(whole(rng, 1, 5)):
        room.against_wall("tall cabinet", shaped, wall, along, gap=0.005, close=CLOSE)
        along += size[0] + 0.008


def waiting_seats(room: Arrangement, wall: Wall) -> None:
    """Stand two to four armchairs side by side against a wall or before it, small tables beside and before them."""
    rng = room.rng
    seats = row(room, "armchair", wall, whole(rng, 2, 4))
    for seat in seats:
        table = room.draw("low table")
        if happens(rng, 0.4):
            ahead = float(seat.box[1, 2]) + depth_of(table) / 2 + between(rng, 0.3, 0.6)
            room.put("low table", table, seat.pose @ pose_of(rng.normal(0.0, 0.2), 0.0, ahead, rng.normal(0.0, 0.1)))
    row(room, "low table", wall, whole(rng, 0, 2))
