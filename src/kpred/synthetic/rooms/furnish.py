"""Furnished rooms: offices, meeting, living and waiting rooms, bedrooms, kitchens, stores, studies; by seed."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from kpred.synthetic.chance import between, happens, pick, whole
from kpred.synthetic.rooms.arrangement import Arrangement
from kpred.synthetic.rooms.catalogue import Catalogue
from kpred.synthetic.rooms.close_furniture import built_in, long_desk, waiting_seats
from kpred.synthetic.rooms.clutter import clutter_floor, clutter_objects
from kpred.synthetic.rooms.fixtures import hang_fixtures
from kpred.synthetic.rooms.groups import bed_group, desk_at_wall, island, lounge, row, table_group, width_of
from kpred.synthetic.rooms.interior_walls import interior_walls
from kpred.synthetic.rooms.room import Room
from kpred.synthetic.rooms.shell import Wall, build_shell

Recipe = Callable[[Arrangement], None]


def furnish_room(seed: int, index: int, catalogue: Catalogue) -> Room:
    """Build room `index` of a seed, from these and the catalogue only; metres, y up, floor at y = 0."""
    rng = np.random.default_rng([seed, index, 7])
    name = pick(rng, list(RECIPES), [weight for _, weight in RECIPES.values()])
    size = np.array([between(rng, 2.6, 6.5), between(rng, 2.4, 3.1), between(rng, 2.6, 6.5)])
    shell, walls = build_shell(size, rng)
    for wall in walls:
        shell += [] if wall.is_open else hang_fixtures(wall, rng)
    shell += interior_walls(size, rng)
    room = Arrangement(size, walls, shell, catalogue, rng)
    RECIPES[name][0](room)
    full = between(rng, 0.3, 1.1) * size[0] * size[2]
    for _ in range(6):
        if _furniture(room) < full:
            RECIPES[pick(rng, [name, name, "office", "living", "meeting", "store"])][0](room)
    for _ in range(whole(rng, 1, 2) if happens(rng, 0.4) else 0):
        # Cabinets divide rooms too.
        role = pick(rng, ["tall cabinet", "low cabinet", "nightstand"])
        room.anywhere(role, room.draw(role))
    for _ in range(whole(rng, 0, 3)):
        role = pick(rng, ["floor thing", "plant", "lamp", "wall thing", "vessel"])
        room.anywhere(role, room.draw(role))
    crowded = 3.0 * between(rng, 0.0, 1.0) ** 1.3
    clutter_objects(room, crowded)
    clutter_floor(room, int(rng.poisson(5.0 * crowded)))
    return Room(size, room.objects)


def _furniture(room: Arrangement) -> int:
    return sum(item.category in ("chair", "table", "cabinet") for item in room.objects)


def _walls(room: Arrangement) -> list[Wall]:
    """Return the walls in random order."""
    return [room.walls[int(number)] for number in room.rng.permutation(len(room.walls))]


def _spots(wall: Wall, step: float) -> np.ndarray:
    count = max(1, int(wall.length / step))
    return np.asarray((np.arange(count) + 0.5 - count / 2) * step)


def office(room: Arrangement) -> None:
    """Furnish desks along walls or in an island, office chairs, cabinets, sometimes other chairs."""
    rng, walls = room.rng, _walls(room)
    desk, chair = room.draw("desk"), room.draw("office chair")
    if min(room.size[[0, 2]]) > 4.0 and happens(rng, 0.35):
        island(room, whole(rng, 1, 3))
    for wall in walls[: whole(rng, 1, 3)]:
        joined = happens(rng, 0.5)
        for middle in _spots(wall, width_of(desk) + (0.01 if joined else 0.15)):
            if happens(rng, 0.9 if joined else 0.65):
                desk_at_wall(room, wall, desk, chair, float(middle))
            if not joined and happens(rng, 0.3):
                desk, chair = room.draw("desk"), room.draw("office chair")
    for wall in walls:
        row(room, pick(rng, ["tall cabinet", "low cabinet"]), wall, whole(rng, 0, 4))
    if happens(rng, 0.2):
        built_in(room, walls[-1])
    for wall in walls[: whole(rng, 0, 2)]:
        row(room, "wall cabinet", wall, whole(rng, 1, 4), height=between(rng, 1.15, 1.5))
    for _ in range(whole(rng, 0, 2)):
        room.anywhere("office chair", chair if happens(rng, 0.5) else room.draw("office chair"))
    if happens(rng, 0.3):
        table_group(room, pick(rng, ["low table", "dining table"]), "office chair", 4)


def meeting(room: Arrangement) -> None:
    """Furnish a table in the middle with many chairs, more chairs along a wall, a few cabinets."""
    rng, walls = room.rng, _walls(room)
    chairs = pick(rng, ["office chair", "dining chair"])
    for _ in range(whole(rng, 1, 2)):
        table_group(room, "dining table", chairs, 14)
    row(room, chairs, walls[0], whole(rng, 0, 5))
    row(room, pick(rng, ["low cabinet", "tall cabinet"]), walls[1], whole(rng, 0, 3))
    if happens(rng, 0.3):
        row(room, "low table", walls[2], 1)


def living(room: Arrangement) -> None:
    """Furnish one or two sofas with low tables and armchairs, cabinets, often a table with chairs."""
    rng, walls = room.rng, _walls(room)
    for wall in walls[: whole(rng, 1, 2)]:
        lounge(room, wall)
    row(room, "low cabinet", walls[2], whole(rng, 1, 2))
    row(room, "tall cabinet", walls[3], whole(rng, 0, 3))
    if happens(rng, 0.6):
        table_group(room, "dining table", "dining chair", 6)
    if happens(rng, 0.4):
        row(room, "low table", walls[1], 1)
    for _ in range(whole(rng, 0, 2)):
        room.anywhere("armchair", room.draw("armchair"))


def bedroom(room: Arrangement) -> None:
    """Furnish a bed or two with nightstands, a wardrobe, a chest, a desk, an armchair."""
    rng, walls = room.rng, _walls(room)
    bed_group(room, walls[0])
    if happens(rng, 0.3):
        bed_group(room, walls[0])
    if happens(rng, 0.3):
        built_in(room, walls[1])
    row(room, "tall cabinet", walls[1], whole(rng, 1, 3))
    row(room, "low cabinet", walls[2], whole(rng, 0, 2))
    if happens(rng, 0.7):
        desk_at_wall(room, walls[3], room.draw("desk"), room.draw("dining chair"), between(rng, -1.0, 1.0))
    if happens(rng, 0.5):
        room.anywhere("armchair", room.draw("armchair"))
    if happens(rng, 0.4):
        table_group(room, "low table", "armchair", 2)


def kitchen(room: Arrangement) -> None:
    """Furnish low cabinets in a row with others above them, a table with chairs or stools."""
    rng, walls = room.rng, _walls(room)
    for wall in walls[: whole(rng, 1, 2)]:
        row(room, "low cabinet", wall, whole(rng, 2, 6))
        row(room, "wall cabinet", wall, whole(rng, 0, 5), height=between(rng, 1.35, 1.5))
    row(room, "tall cabinet", walls[2], whole(rng, 0, 2))
    if happens(rng, 0.3):
        table_group(room, "bar table", "bar stool", 4)
    else:
        table_group(room, "dining table", "dining chair", 6)


def store(room: Arrangement) -> None:
    """Furnish shelves and cabinets along all walls, a table, stray chairs, many boxes."""
    rng = room.rng
    for wall in _walls(room)[: whole(rng, 2, 4)]:
        if happens(rng, 0.3):
            built_in(room, wall)
        row(room, "tall cabinet", wall, whole(rng, 2, 6))
    if happens(rng, 0.6):
        table_group(room, pick(rng, ["desk", "dining table", "bar table"]), "office chair", 2)
    for _ in range(whole(rng, 1, 4)):
        role = pick(rng, ["dining chair", "office chair", "bar stool"])
        room.anywhere(role, room.draw(role))
    clutter_floor(room, whole(rng, 2, 8))


def study(room: Arrangement) -> None:
    """Furnish long tops along walls, shelves hung above them, full bookcases, chairs."""
    rng, walls = room.rng, _walls(room)
    chair = room.draw("office chair")
    for wall in walls[: whole(rng, 1, 3)]:
        long_desk(room, wall, chair)
        if happens(rng, 0.6):
            row(room, "wall cabinet", wall, whole(rng, 1, 5), height=between(rng, 1.05, 1.5))
    for wall in walls[1:]:
        row(room, "tall cabinet", wall, whole(rng, 0, 4))
    for _ in range(whole(rng, 0, 3)):
        room.anywhere("office chair", chair if happens(rng, 0.6) else room.draw("office chair"))


def waiting(room: Arrangement) -> None:
    """Furnish armchairs side by side, along walls and back to back, with small low tables between them."""
    rng, walls = room.rng, _walls(room)
    for wall in walls[: whole(rng, 1, 3)]:
        waiting_seats(room, wall)
    lounge(room, walls[3])
    if happens(rng, 0.5):
        table_group(room, "low table", "armchair", 4)
    row(room, pick(rng, ["low cabinet", "tall cabinet"]), walls[2], whole(rng, 0, 2))


RECIPES: dict[str, tuple[Recipe, float]] = {
    "office": (office, 0.24),
    "meeting": (meeting, 0.12),
    "living": (living, 0.16),
    "bedroom": (bedroom, 0.12),
    "kitchen": (kitchen, 0.1),
    "store": (store, 0.06),
    "study": (study, 0.12),
    "waiting": (waiting, 0.08),
}
"""Name -> how a kind of room is furnished, and its fraction of the rooms."""
