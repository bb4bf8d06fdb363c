"""Clutter: small things on tops, in shelves, on seats and on the floor."""

from __future__ import annotations

import numpy as np

from kpred.synthetic.rooms.arrangement import Arrangement
from kpred.synthetic.rooms.room import RoomObject, pose_of
from kpred.synthetic.rooms.small_things import ON_DESKS, ON_FLOORS, ON_SEATS, ON_SHELVES, ON_TABLES, Small, small_thing

LEVEL = 0.97
"""Least vertical component of the normal of a face that things lie on."""

MIN_AREA = 0.015
"""Smallest such face, square metres."""

FULL, FULL_THINGS = 0.4, 60
"""Fraction of the cabinets that are as full as they get, and how many things are tried there."""

GLOSSY = ("monitor", "screen", "laptop")


def clutter_objects(room: Arrangement, density: float) -> None:
    """Lay small things on and into the furniture; `density` 0 is none, 1 is crowded."""
    rng = room.rng
    for item in list(room.objects):
        kinds = _kinds_for(item)
        if kinds is None:
            continue
        area = float(np.prod(np.ptp(item.box, axis=0)[[0, 2]]))
        if item.category == "cabinet":
            area *= max(1.0, float(item.box[1, 1]) / 0.4)
        if item.category == "chair":
            most = int(rng.random() < 0.25 * density)
        else:
            most = int(rng.poisson(density * 5.0 * area))
        supports = level_faces(item)
        most = min(most, 24)
        if item.category == "cabinet" and rng.random() < FULL:
            most = FULL_THINGS
        for _ in range(most if len(supports) else 0):
            _lay(room, item, supports, kinds)


def clutter_floor(room: Arrangement, count: int) -> None:
    """Lay small things on the floor, also under tables."""
    rng = room.rng
    for _ in range(count):
        name, mesh = small_thing(ON_FLOORS, rng)
        for _ in range(4):
            x, z = (float(rng.uniform(-side, side)) for side in room.size[[0, 2]] / 2 - 0.2)
            if room.put_small(name, mesh, pose_of(x, 0.0, z, float(rng.uniform(0, 2 * np.pi)))) is not None:
                break


def level_faces(item: RoomObject) -> np.ndarray:
    """Return corners (F, 3, 3), in the object's frame, of level faces large enough to carry something."""
    corners = np.asarray(item.mesh.vertices, dtype=np.float64)[np.asarray(item.mesh.faces)]
    cross = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    twice = np.linalg.norm(cross, axis=1)
    level = (np.abs(cross[:, 1]) > LEVEL * twice) & (twice > 2 * MIN_AREA) & (corners[:, 0, 1] > 0.15)
    return np.asarray(corners[level])


def _kinds_for(item: RoomObject) -> dict[str, Small] | None:
    if item.category == "table":
        return ON_DESKS if "desk" in item.name.lower() or "workbench" in item.name else ON_TABLES
    if item.category == "cabinet":
        return ON_SHELVES
    if item.category == "chair" or item.name in ("sofa_two", "sofa_three", "chaise", "bed"):
        return ON_SEATS
    return None


def _lay(room: Arrangement, item: RoomObject, supports: np.ndarray, kinds: dict[str, Small]) -> None:
    rng = room.rng
    areas = np.linalg.norm(np.cross(supports[:, 1] - supports[:, 0], supports[:, 2] - supports[:, 0]), axis=1)
    name, mesh = small_thing(kinds, rng)
    half = np.ptp(mesh.vertices, axis=0)[[0, 2]] / 2
    for _ in range(3):
        face = supports[int(rng.choice(len(supports), p=areas / areas.sum()))]
        u, v = np.sort(rng.random(2))
        place = face[0] * u + face[1] * (v - u) + face[2] * (1 - v)
        # On shelves and desks things stand about square to the furniture.
        turn = float(rng.normal(0.0, 0.15)) if kinds in (ON_SHELVES, ON_DESKS) else float(rng.uniform(0, 2 * np.pi))
        reach = np.abs([[np.cos(turn), np.sin(turn)], [np.sin(turn), np.cos(turn)]]) @ half
        low, high = item.box[0, [0, 2]] + reach * 0.8, item.box[1, [0, 2]] - reach * 0.8
        if (low > high).any():
            continue
        x, z = np.clip(place[[0, 2]], low, high)
        pose = item.pose @ pose_of(float(x), float(place[1]) + 0.002, float(z), turn)
        loss = float(rng.uniform(0.3, 0.8)) if name in GLOSSY and rng.random() < 0.5 else 0.0
        if room.put_small(name, mesh, pose, loss) is not None:
            return
