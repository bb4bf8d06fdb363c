"""Floor, walls with doors and windows, ceiling, columns: the shell of a room."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from kpred.shapes.mesh import Mesh
from kpred.synthetic.assembly import assemble
from kpred.synthetic.chance import between, happens, pick, whole
from kpred.synthetic.parts import Part, box, cylinder
from kpred.synthetic.rooms.room import OTHER, STRUCTURE, RoomObject, pose_of

THICKNESS = 0.12
CORRIDOR = 1.5
"""Depth of the floor that is seen through an open door, metres."""

BEYOND = 1.2
"""Metres by which the floor goes on where there is no wall."""


@dataclass(frozen=True, eq=False)
class Wall:
    """One wall of a room.

    Attributes:
        pose: (4, 4) from the wall's frame (x along the wall from its middle, y up, z into the room) to the room's.
        length: metres along x.
        doors, windows: spans (x0, x1) that furniture leaves free of itself.
        is_open: there is no wall: the room is a part of a larger one.
    """

    pose: np.ndarray
    length: float
    doors: tuple[tuple[float, float], ...] = ()
    windows: tuple[tuple[float, float], ...] = ()
    is_open: bool = False


@dataclass(frozen=True)
class _Opening:
    left: float
    right: float
    bottom: float
    top: float
    is_door: bool


def build_shell(size: np.ndarray, rng: np.random.Generator) -> tuple[list[RoomObject], list[Wall]]:
    """Build the shell of a room of a size (width, height, depth; metres): its objects, and its four walls."""
    width, height, depth = (float(side) for side in size)
    sides = [
        (pose_of(0.0, 0.0, -depth / 2, 0.0), width),
        (pose_of(width / 2, 0.0, 0.0, -np.pi / 2), depth),
        (pose_of(0.0, 0.0, depth / 2, np.pi), width),
        (pose_of(-width / 2, 0.0, 0.0, np.pi / 2), depth),
    ]
    door_side = whole(rng, 0, 3)
    window_sides = {whole(rng, 0, 3)} if happens(rng, 0.85) else set()
    missing = set(rng.permutation(4)[: whole(rng, 1, 2)].tolist()) if happens(rng, 0.25) else set()
    beyond = BEYOND if missing else 0.0
    objects = [_floor(width + 2 * beyond, depth + 2 * beyond)]
    if happens(rng, 0.9):
        objects.append(_ceiling(width, height, depth))
    walls = []
    for number, (pose, length) in enumerate(sides):
        if number in missing:
            walls.append(Wall(pose, length, is_open=True))
            continue
        openings: list[_Opening] = []
        for _ in range(1 + happens(rng, 0.15) if number == door_side else 0):
            openings += _opening(rng, length, height, openings, True)
        for _ in range(whole(rng, 1, 3) if number in window_sides else 0):
            openings += _opening(rng, length, height, openings, False)
        objects.append(RoomObject("wall", STRUCTURE, _mesh(_wall_parts(length, height, openings), "wall"), pose))
        for opening in openings:
            objects += _door(rng, opening, pose) if opening.is_door else _window(rng, opening, pose, height)
        doors = tuple((o.left - 0.2, o.right + 0.2) for o in openings if o.is_door)
        windows = tuple((o.left, o.right) for o in openings if not o.is_door)
        walls.append(Wall(pose, length, doors, windows))
    for _ in range(whole(rng, 0, 2) if happens(rng, 0.4) else 0):
        objects.append(_column(rng, width, height, depth))
    return objects, walls


def _mesh(parts: list[Part], name: str) -> Mesh:
    """Join parts as they are, not moved to the floor."""
    starts = np.cumsum([0, *(len(part.vertices) for part in parts)])
    vertices = np.concatenate([part.vertices for part in parts]).astype(np.float32)
    faces = [part.faces + start for part, start in zip(parts, starts, strict=False)]
    return Mesh(vertices, np.concatenate(faces).astype(np.int32), name)


def _floor(width: float, depth: float) -> RoomObject:
    size = (width + 2 * THICKNESS, 0.05, depth + 2 * THICKNESS)
    return RoomObject("floor", STRUCTURE, _mesh([box(size, (0.0, -0.025, 0.0), "floor")], "floor"), np.eye(4))


def _ceiling(width: float, height: float, depth: float) -> RoomObject:
    slab = box((width, 0.05, depth), (0.0, height + 0.025, 0.0), "ceiling")
    return RoomObject("ceiling", STRUCTURE, _mesh([slab], "ceiling"), np.eye(4))


def _opening(
    rng: np.random.Generator, length: float, height: float, others: list[_Opening], is_door: bool
) -> list[_Opening]:
    """Draw one opening that is apart from the others, or none."""
    wide = between(rng, 0.8, 1.0) if is_door else between(rng, 0.7, min(2.6, 0.8 * length))
    bottom, top = (0.0, between(rng, 2.0, 2.12)) if is_door else (between(rng, 0.5, 1.1), between(rng, 1.9, 2.3))
    top = min(top, height - 0.1)
    for _ in range(6):
        middle = between(rng, -length / 2 + wide / 2 + 0.15, length / 2 - wide / 2 - 0.15)
        left, right = middle - wide / 2, middle + wide / 2
        if left > -length / 2 and all(right + 0.15 < o.left or o.right + 0.15 < left for o in others):
            return [_Opening(left, right, bottom, top, is_door)]
    return []


def _wall_parts(length: float, height: float, openings: list[_Opening]) -> list[Part]:
    """Build panels around the openings; the inner face lies at z = 0."""
    parts = []
    edges = sorted({-length / 2, length / 2, *(o.left for o in openings), *(o.right for o in openings)})
    for left, right in zip(edges, edges[1:], strict=False):
        inside = [o for o in openings if o.left <= left + 1e-6 and right - 1e-6 <= o.right]
        spans = [(0.0, inside[0].bottom), (inside[0].top, height)] if inside else [(0.0, height)]
        for bottom, top in spans:
            if top - bottom > 0.01:
                center = ((left + right) / 2, (bottom + top) / 2, -THICKNESS / 2)
                parts.append(box((right - left, top - bottom, THICKNESS), center, "wall"))
    return parts


def _door(rng: np.random.Generator, opening: _Opening, pose: np.ndarray) -> list[RoomObject]:
    wide, tall = opening.right - opening.left, opening.top
    jambs = [
        box((0.06, tall, THICKNESS + 0.03), (x, tall / 2, -THICKNESS / 2), "frame")
        for x in (-wide / 2 + 0.03, wide / 2 - 0.03)
    ]
    leaf = [box((wide - 0.1, tall - 0.03, 0.04), (0.0, tall / 2 - 0.01, -0.03), "leaf")]
    leaf.append(cylinder(0.012, (0.38 * wide, 1.0, -0.01), (0.38 * wide, 1.0, 0.06), "handle", sides=6))
    leaf.append(box((0.12, 0.02, 0.02), (0.38 * wide - 0.05, 1.0, 0.06), "handle"))
    objects = []
    if happens(rng, 0.4):
        # It opens out of the room: what furnishes the room cannot be in its way.
        hinge = np.array([-wide / 2 + 0.05, 0.0, -0.03])
        turn = between(rng, 30.0, 110.0)
        leaf = [part.rotated("y", turn, hinge) for part in leaf]
        floor = box((wide + 1.2, 0.05, CORRIDOR), (0.0, -0.026, -THICKNESS - CORRIDOR / 2), "floor")
        back = box((wide + 1.2, 2.3, 0.05), (0.0, 1.15, -THICKNESS - CORRIDOR), "wall")
        centre = (opening.left + opening.right) / 2
        parts = [floor, back] if happens(rng, 0.7) else [floor]
        objects.append(RoomObject("corridor", STRUCTURE, _mesh(parts, "corridor"), pose @ pose_of(centre, 0.0, 0.0)))
    place = pose @ pose_of((opening.left + opening.right) / 2, 0.0, 0.0)
    return [*objects, RoomObject("door", OTHER, _mesh([*jambs, *leaf], "door"), place)]


def _window(rng: np.random.Generator, opening: _Opening, pose: np.ndarray, height: float) -> list[RoomObject]:
    """Build a frame without glass (invisible to the sensor) or with glass; sometimes a curtain or blinds."""
    wide, tall = opening.right - opening.left, opening.top - opening.bottom
    middle = ((opening.left + opening.right) / 2, (opening.bottom + opening.top) / 2)
    bar, deep = between(rng, 0.04, 0.08), -between(rng, 0.04, 0.1)
    parts = [box((bar, tall, 0.05), (x, 0.0, deep), "frame") for x in (-wide / 2 + bar / 2, wide / 2 - bar / 2)]
    parts += [box((wide, bar, 0.05), (0.0, y, deep), "frame") for y in (-tall / 2 + bar / 2, tall / 2 - bar / 2)]
    parts += [
        box((bar, tall, 0.05), (x, 0.0, deep), "frame")
        for x in np.linspace(-wide / 2, wide / 2, whole(rng, 2, 4))[1:-1]
    ]
    glass = happens(rng, 0.4)
    if glass:
        parts.append(box((wide, tall, 0.01), (0.0, 0.0, deep), "glass"))
    loss = between(rng, 0.3, 0.8) if glass else 0.1
    objects = [RoomObject("window", OTHER, _mesh(parts, "window"), pose @ pose_of(*middle, 0.0), loss)]
    if happens(rng, 0.35):
        objects.append(_covering(rng, wide, tall, opening, pose, height))
    return objects


def _covering(
    rng: np.random.Generator, wide: float, tall: float, opening: _Opening, pose: np.ndarray, height: float
) -> RoomObject:
    centre = (opening.left + opening.right) / 2
    if happens(rng, 0.4):
        drop = tall * between(rng, 0.3, 1.0)
        blinds = [box((wide, drop, 0.02), (0.0, opening.top - drop / 2, 0.02), "blinds")]
        return RoomObject("blinds", OTHER, _mesh(blinds, "blinds"), pose @ pose_of(centre, 0.0, 0.0))
    bottom = 0.03 if happens(rng, 0.7) else opening.bottom - 0.1
    top = min(height - 0.02, opening.top + 0.2)
    strips = []
    for side in (-1.0, 1.0):
        cover = between(rng, 0.15, 0.5) * wide
        count = max(3, int(cover / 0.07))
        for n in range(count):
            x = side * (wide / 2 + 0.15 - (n + 0.5) * cover / count)
            z = 0.06 + 0.035 * (n % 2)
            strips.append(box((cover / count + 0.01, top - bottom, 0.015), (x, (top + bottom) / 2, z), "curtain"))
    return RoomObject("curtain", OTHER, _mesh(strips, "curtain"), pose @ pose_of(centre, 0.0, 0.0))


def _column(rng: np.random.Generator, width: float, height: float, depth: float) -> RoomObject:
    wide, deep = between(rng, 0.2, 0.6), between(rng, 0.2, 0.6)
    parts = [box((wide, height - 0.01, deep), (0.0, height / 2, 0.0), "column")]
    x = pick(rng, [-1.0, 1.0]) * (width - wide) / 2
    z = pick(rng, [-1.0, 1.0]) * (depth - deep) / 2 if happens(rng, 0.6) else between(rng, -0.3, 0.3) * depth
    return RoomObject("column", OTHER, assemble(parts, "column"), pose_of(x, 0.0, z))
