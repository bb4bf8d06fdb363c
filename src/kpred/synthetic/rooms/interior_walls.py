"""Walls inside of a room: corners that make it no rectangle, partitions, and low screens between desks."""

from __future__ import annotations

import numpy as np

from kpred.synthetic.assembly import assemble
from kpred.synthetic.chance import between, happens, pick, whole
from kpred.synthetic.parts import box
from kpred.synthetic.rooms.room import OTHER, RoomObject, pose_of

THICKNESS = 0.1


def interior_walls(size: np.ndarray, rng: np.random.Generator) -> list[RoomObject]:
    """Build walls for a room of a size (width, height, depth; metres), none in half of the rooms."""
    found = []
    if happens(rng, 0.35):
        found.append(_corner(size, rng))
    if happens(rng, 0.25):
        found += [_partition(size, rng) for _ in range(whole(rng, 1, 2))]
    return found


def _corner(size: np.ndarray, rng: np.random.Generator) -> RoomObject:
    """Build a closed corner up to the ceiling, which leaves an L of the room."""
    wide, deep = (between(rng, 0.2, 0.5) * float(side) for side in size[[0, 2]])
    tall = float(size[1]) - 0.01
    x, z = (pick(rng, [-1.0, 1.0]) * (whole_side - own) / 2 for whole_side, own in zip(size[[0, 2]], (wide, deep)))
    mesh = assemble([box((wide, tall, deep), (0.0, tall / 2, 0.0), "wall")], "corner")
    return RoomObject("corner", OTHER, mesh, pose_of(float(x), 0.0, float(z)))


def _partition(size: np.ndarray, rng: np.random.Generator) -> RoomObject:
    """Build a thin wall that starts at a wall of the room: full height, or a screen of the height of a person."""
    turned = happens(rng, 0.5)
    across, along = (0, 2) if turned else (2, 0)
    long = between(rng, 0.2, 0.55) * float(size[along])
    tall = float(size[1]) - 0.01 if happens(rng, 0.5) else between(rng, 1.0, 1.7)
    mesh = assemble([box((long, tall, THICKNESS), (0.0, tall / 2, 0.0), "wall")], "partition")
    start = pick(rng, [-1.0, 1.0]) * (float(size[along]) - long) / 2
    aside = between(rng, -0.3, 0.3) * float(size[across])
    x, z = (aside, start) if turned else (start, aside)
    return RoomObject("partition", OTHER, mesh, pose_of(float(x), 0.0, float(z), np.pi / 2 if turned else 0.0))
