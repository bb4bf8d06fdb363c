"""Flat things on walls: boards, pictures, televisions, and radiators below them."""

from __future__ import annotations

import numpy as np

from kpred.synthetic.assembly import assemble
from kpred.synthetic.chance import between, happens, pick, whole
from kpred.synthetic.parts import Part, box
from kpred.synthetic.rooms.room import OTHER, RoomObject, pose_of
from kpred.synthetic.rooms.shell import Wall

KINDS = ("picture", "picture", "board", "television", "vent", "radiator", "panel")


def hang_fixtures(wall: Wall, rng: np.random.Generator) -> list[RoomObject]:
    """Return hang none to three things on a wall, apart from its openings; they stand out by centimetres."""
    taken = [*wall.doors, *wall.windows]
    found = []
    for _ in range(whole(rng, 0, 3)):
        kind = pick(rng, KINDS)
        parts, low = _build(kind, rng)
        mesh = assemble(parts, kind)
        half = float(mesh.vertices[:, 0].max())
        reach = wall.length / 2 - half - 0.05
        middle = between(rng, -reach, reach) if reach > 0 else None
        if middle is None or any(middle + half > a and middle - half < b for a, b in taken):
            continue
        taken.append((middle - half, middle + half))
        back = float(-mesh.vertices[:, 2].min()) + 0.004
        loss = between(rng, 0.3, 0.9) if kind == "television" else 0.0
        found.append(RoomObject(kind, OTHER, mesh, wall.pose @ pose_of(middle, low, back), loss))
    return found


def _build(kind: str, rng: np.random.Generator) -> tuple[list[Part], float]:
    """Build parts; also return the height of their lower edge."""
    if kind == "picture":
        size = (between(rng, 0.2, 1.0), between(rng, 0.2, 0.8), between(rng, 0.015, 0.04))
        return _framed(size, rng), between(rng, 1.1, 1.6)
    if kind == "board":
        size = (between(rng, 0.9, 2.4), between(rng, 0.8, 1.2), between(rng, 0.015, 0.03))
        parts = _framed(size, rng)
        parts.append(box((0.5 * size[0], 0.02, 0.08), (0.0, 0.0, 0.05), "ledge"))
        return parts, between(rng, 0.8, 1.1)
    if kind == "television":
        size = (between(rng, 0.8, 1.5), between(rng, 0.45, 0.85), between(rng, 0.03, 0.08))
        return [box(size, (0.0, size[1] / 2, 0.0), "screen")], between(rng, 0.9, 1.4)
    if kind == "radiator":
        wide, tall = between(rng, 0.5, 1.4), between(rng, 0.4, 0.7)
        return [box((wide, tall, 0.1), (0.0, tall / 2, 0.0), "radiator")], 0.12
    if kind == "vent":
        side = between(rng, 0.15, 0.5)
        return [box((side, 0.6 * side, 0.03), (0.0, 0.3 * side, 0.0), "vent")], between(rng, 1.9, 2.1)
    size = (between(rng, 0.1, 0.3), between(rng, 0.15, 0.4), between(rng, 0.03, 0.12))
    return [box(size, (0.0, size[1] / 2, 0.0), "panel")], between(rng, 1.0, 1.4)


def _framed(size: tuple[float, float, float], rng: np.random.Generator) -> list[Part]:
    wide, tall, deep = size
    parts = [box((wide, tall, deep), (0.0, tall / 2, 0.0), "panel")]
    if happens(rng, 0.5):
        rim = 0.03
        parts += [box((wide, rim, deep + 0.02), (0.0, y, 0.01), "frame") for y in (rim / 2, tall - rim / 2)]
        parts += [box((rim, tall, deep + 0.02), (x, tall / 2, 0.01), "frame") for x in (-wide / 2, wide / 2)]
    return parts
