"""Groups of furniture: rows along walls, tables with chairs, desks, seats around a low table, beds."""

from __future__ import annotations

import numpy as np

from kpred.shapes.mesh import Mesh
from kpred.synthetic.chance import between, happens, pick, whole
from kpred.synthetic.rooms.arrangement import Arrangement
from kpred.synthetic.rooms.room import RoomObject, pose_of
from kpred.synthetic.rooms.shell import Wall

SEAT_WIDTH = 0.62
"""Length of a table's side that a chair takes, metres."""

CLOSE = 0.045
"""Metres by which boxes that stand side by side are narrowed where it is tested whether they fit: more than a voxel."""


def width_of(mesh: Mesh) -> float:
    """Measure the width (x) of a shape, metres."""
    return float(np.ptp(mesh.vertices[:, 0]))


def depth_of(mesh: Mesh) -> float:
    """Measure the depth (z) of a shape, metres."""
    return float(np.ptp(mesh.vertices[:, 2]))


def row(room: Arrangement, role: str, wall: Wall, count: int, height: float = 0.0) -> list[RoomObject]:
    """Stand up to `count` pieces side by side against a wall, mostly all of one shape."""
    rng = room.rng
    same = room.draw(role) if happens(rng, 0.65) else None
    gap = pick(rng, [0.0, 0.0, 0.005, 0.02, 0.1])
    along = between(rng, -0.5, -0.15) * wall.length + 0.05
    back = between(rng, 0.0, 0.06)
    found: list[RoomObject] = []
    mesh = room.draw(role) if same is None else same
    while len(found) < count and along + width_of(mesh) < wall.length / 2:
        item = room.against_wall(role, mesh, wall, along + width_of(mesh) / 2, height, back, CLOSE)
        if item is None:
            along += 0.12
            continue
        found.append(item)
        along += width_of(mesh) + max(gap, 0.008)
        mesh = room.draw(role) if same is None else same
    return found


def seats(room: Arrangement, table: RoomObject, role: str, most: int) -> list[RoomObject]:
    """Put chairs around a table, most of them pushed under it, some pulled out or turned away."""
    rng = room.rng
    mesh = room.draw(role)
    mixed = happens(rng, 0.2)
    places = _round_places(table, rng) if "round" in table.name else _side_places(table, rng)
    order = rng.permutation(len(places))[:most]
    found = []
    for number in order:
        place, outward = places[int(number)]
        chair = room.draw(role) if mixed else mesh
        item = pushed_in(room, table, place, outward, chair, role)
        if item is not None:
            found.append(item)
    return found


def pushed_in(
    room: Arrangement, table: RoomObject, place: np.ndarray, outward: np.ndarray, chair: Mesh, role: str
) -> RoomObject | None:
    """Put a chair that faces a table, from under it outwards until it fits.

    `place`, `outward` (x, z): a point of the table's edge and the direction away from it, in the table's frame.
    """
    rng = room.rng
    turn = float(rng.normal(0.0, np.radians(10.0)))
    if happens(rng, 0.12):
        turn = between(rng, -np.pi, np.pi)
    first = depth_of(chair) * between(rng, -0.3, 0.2)
    if happens(rng, 0.25):
        first += between(rng, 0.1, 0.6)
    # The chair's front, +z, looks at the table.
    facing = np.arctan2(-outward[0], -outward[1]) + turn
    for step in np.arange(0.0, 0.6, 0.03):
        x, z = place + outward * (first + step)
        item = room.put(role, chair, table.pose @ pose_of(float(x), 0.0, float(z), float(facing)))
        if item is not None:
            return item
    return None


def _side_places(table: RoomObject, rng: np.random.Generator) -> list[tuple[np.ndarray, np.ndarray]]:
    low, high = table.box
    half = np.array([high[0], high[2]])
    found = []
    for axis, sign in ((1, 1.0), (1, -1.0), (0, 1.0), (0, -1.0)):
        length = 2 * half[1 - axis]
        count = int(length / SEAT_WIDTH)
        outward = np.zeros(2)
        outward[axis] = sign
        for n in range(count):
            place = outward * half[axis]
            place[1 - axis] = (n + 0.5) / count * length - length / 2 + rng.normal(0.0, 0.04)
            found.append((place, outward))
    return found


def _round_places(table: RoomObject, rng: np.random.Generator) -> list[tuple[np.ndarray, np.ndarray]]:
    radius = float(table.box[1, 0])
    count = max(2, int(2 * np.pi * radius / (1.2 * SEAT_WIDTH)))
    start = between(rng, 0.0, 2 * np.pi)
    angles = start + 2 * np.pi * np.arange(count) / count
    return [(radius * np.array([np.sin(a), np.cos(a)]), np.array([np.sin(a), np.cos(a)])) for a in angles]


def table_group(room: Arrangement, table_role: str, chair_role: str, most: int) -> list[RoomObject]:
    """Stand a table about the middle of free floor, along a wall's direction, with chairs."""
    rng = room.rng
    mesh = room.draw(table_role)
    for _ in range(8):
        spread = room.size[[0, 2]] / 2 * 0.6
        x, z = (between(rng, -side, side) for side in spread)
        yaw = pick(rng, [0.0, 0.5, 1.0, 1.5]) * np.pi + rng.normal(0.0, 0.04)
        table = room.put(table_role, mesh, pose_of(x, 0.0, z, float(yaw)))
        if table is not None:
            return [table, *seats(room, table, chair_role, most)]
    return []


def shelf_on(room: Arrangement, desk: RoomObject) -> list[RoomObject]:
    """Stand a shelf on the back of a desk, of its width or less; none where the desk has one of its own."""
    rng = room.rng
    wide, tall, deep = np.ptp(desk.box, axis=0)
    if not 0.6 < tall < 0.9:
        return []
    mesh = room.draw("wall cabinet")
    own = np.ptp(mesh.vertices, axis=0)
    size = np.array(
        [wide * pick(rng, [1.0, 1.0, 0.6]), between(rng, 0.4, 1.3), min(between(rng, 0.22, 0.45), 0.6 * deep)]
    )
    shaped = Mesh((mesh.vertices * (size / own)).astype(np.float32), mesh.faces, mesh.name)
    aside = between(rng, -1.0, 1.0) * (wide - size[0]) / 2
    back = float(desk.box[0, 2]) + size[2] / 2
    item = room.put("wall cabinet", shaped, desk.pose @ pose_of(aside, tall + 0.006, back), CLOSE, 0.05)
    return [] if item is None else [item]


def desk_at_wall(room: Arrangement, wall: Wall, mesh: Mesh, chair: Mesh, middle: float) -> RoomObject | None:
    """Stand a desk with its back to a wall and a chair before it."""
    desk = room.against_wall("desk", mesh, wall, middle, gap=between(room.rng, 0.0, 0.06), close=CLOSE)
    if desk is not None and happens(room.rng, 0.25):
        shelf_on(room, desk)
    if desk is not None and happens(room.rng, 0.9):
        front = np.array([room.rng.normal(0.0, 0.1), float(desk.box[1, 2])])
        pushed_in(room, desk, front, np.array([0.0, 1.0]), chair, "office chair")
    return desk


def island(room: Arrangement, count: int) -> list[RoomObject]:
    """Stand desks back to back, in two rows, with chairs on the outer sides."""
    rng = room.rng
    mesh, chair = room.draw("desk"), room.draw("office chair")
    wide, deep = width_of(mesh), depth_of(mesh)
    turned = pick(rng, [0.0, 0.5]) * np.pi + rng.normal(0.0, 0.02)
    x, z = (between(rng, -0.2, 0.2) * side for side in room.size[[0, 2]])
    base = pose_of(x, 0.0, z, float(turned))
    shelved = happens(rng, 0.35)
    found: list[RoomObject] = []
    for n in range(count):
        for side in (0.0, np.pi):
            along = (n - (count - 1) / 2) * (wide + 0.01)
            across = (deep / 2 + 0.01) * (1.0 if side == 0.0 else -1.0)
            desk = room.put("desk", mesh, base @ pose_of(along, 0.0, across, side), CLOSE)
            if desk is None:
                continue
            found.append(desk)
            if shelved:
                found += shelf_on(room, desk)
            front = np.array([rng.normal(0.0, 0.1), float(desk.box[1, 2])])
            pushed_in(room, desk, front, np.array([0.0, 1.0]), chair, "office chair")
    return found


def lounge(room: Arrangement, wall: Wall) -> list[RoomObject]:
    """Stand a sofa against or before a wall, a low table in front of it, armchairs around."""
    rng = room.rng
    found: list[RoomObject] = []
    sofa = room.draw("sofa")
    gap = 0.05 if happens(rng, 0.6) else between(rng, 0.3, 1.2)
    place = room.against_wall("sofa", sofa, wall, between(rng, -0.3, 0.3) * wall.length, gap=gap)
    if place is None:
        return found
    found.append(place)
    low = room.draw("low table")
    ahead = float(place.box[1, 2]) + depth_of(low) / 2 + between(rng, 0.25, 0.6)
    table = room.put("low table", low, place.pose @ pose_of(rng.normal(0.0, 0.1), 0.0, ahead, rng.normal(0.0, 0.06)))
    if table is not None:
        found.append(table)
    armchair = room.draw("armchair")
    for _ in range(whole(rng, 0, 3)):
        angle = between(rng, -2.2, 2.2)
        reach = between(rng, 0.9, 1.7)
        middle = place.pose @ pose_of(reach * np.sin(angle), 0.0, ahead + reach * np.cos(angle), angle + np.pi)
        item = room.put("armchair", armchair, middle)
        found += [item] if item is not None else []
    if happens(rng, 0.5):
        side = width_of(sofa) / 2 + 0.35
        item = room.put("lamp", room.draw("lamp"), place.pose @ pose_of(side, 0.0, -0.1))
        found += [item] if item is not None else []
    return found


def bed_group(room: Arrangement, wall: Wall) -> list[RoomObject]:
    """Stand a bed with its head to a wall, and nightstands on both sides."""
    rng = room.rng
    bed = room.draw("bed")
    middle = between(rng, -0.3, 0.3) * wall.length
    place = room.against_wall("bed", bed, wall, middle, gap=0.03)
    if place is None:
        return []
    found = [place]
    stand = room.draw("nightstand")
    for side in (-1.0, 1.0):
        if happens(rng, 0.75):
            along = middle + side * (width_of(bed) / 2 + width_of(stand) / 2 + between(rng, 0.05, 0.2))
            item = room.against_wall("nightstand", stand, wall, along)
            found += [item] if item is not None else []
    return found
