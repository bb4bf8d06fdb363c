"""Virtual rooms of a room pack as raw scans: z up, turned, with the true objects."""

from __future__ import annotations

import numpy as np

from kpred.ops.rotations import Y_TO_Z
from kpred.synthetic.rooms.pack import RoomPack, RoomPoints


def upright_room(pack: RoomPack, index: int, yaw: float) -> RoomPoints:
    """Return a room as `RoomPack.room`, in float64, z up, turned by `yaw` (radians)."""
    room = pack.room(index)
    return room._replace(points=room.points.astype(np.float64) @ room_rotation(yaw).T)


def room_rotation(yaw: float) -> np.ndarray:
    """Return the rotation (3, 3) from a pack's room (y up) to z up, turned by `yaw` (radians) about the up axis."""
    cosine, sine = np.cos(yaw), np.sin(yaw)
    return np.array([[cosine, -sine, 0.0], [sine, cosine, 0.0], [0.0, 0.0, 1.0]]) @ Y_TO_Z
