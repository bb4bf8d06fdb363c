"""Packs of scanned virtual rooms by seed."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from kpred.errors import ConfigError
from kpred.shapes.mesh import Mesh
from kpred.shapes.pack import MeshPack
from kpred.synthetic.rooms.catalogue import Catalogue
from kpred.synthetic.rooms.furnish import furnish_room
from kpred.synthetic.rooms.pack import GRID, GRID_REACH, SURFACE_POINTS, UNIT, RoomPack, concatenate_rooms
from kpred.synthetic.rooms.room import OTHER, STRUCTURE, Room, RoomObject
from kpred.synthetic.rooms.scan import SCANNERS, RoomScan, Views, scan_room

SCANNER_SHARES = (0.55, 0.2, 0.15, 0.1)
"""Fractions of the rooms that each of `SCANNERS` scans."""

LARGE = 0.45
"""Other things whose longest side is below this (metres) are clutter: they have no surface arrays."""

SEEN_TOLERANCE = 0.06
"""Distance behind seen surface at which surface still counts as seen, in half longest sides of the object's box."""

Progress = Callable[[str, int, int], None]


def generate_rooms(
    count: int,
    seed: int,
    packs: Sequence[MeshPack] = (),
    first: int = 0,
    scanner: str | None = None,
    points: int | None = None,
    splits: Sequence[str] = ("source", "train"),
    progress: Progress | None = None,
) -> RoomPack:
    """Return furnish and scan `count` rooms; room i depends on seed, i and the packs only.

    Args:
        packs: mesh packs (metres) whose shapes furnish the rooms beside the generator's; splits: which of them.
        first: index of the first room. scanner: one of `SCANNERS` for all rooms; None mixes them.
        points: most points of a room; None keeps what the scanner gives.

    Raises:
        ConfigError: no room, a negative seed, or an unknown scanner.
    """
    if count < 1 or seed < 0 or first < 0:
        raise ConfigError(f"Rooms need a positive count and no negative seed, but have {count}, {seed} and {first}.")
    if scanner is not None and scanner not in SCANNERS:
        raise ConfigError(f"There is no scanner '{scanner}'; choose one of {', '.join(SCANNERS)}.")
    catalogue = Catalogue(seed, packs, splits)
    found = []
    for index in range(first, first + count):
        rng = np.random.default_rng([seed, index, 11])
        kind = str(rng.choice(SCANNERS, p=SCANNER_SHARES)) if scanner is None else scanner
        room = furnish_room(seed, index, catalogue)
        found.append(record_room(room, scan_room(room, kind, rng), (seed, index), points, rng))
        if progress is not None:
            progress("rooms", index - first + 1, count)
    return concatenate_rooms(found)


def record_room(
    room: Room, scan: RoomScan, seed: tuple[int, int], points: int | None, rng: np.random.Generator
) -> RoomPack:
    """Make a pack of one scanned room."""
    chosen = np.sort(rng.permutation(len(scan.points))[:points])
    objects = room.objects
    large = [item.category not in (OTHER, STRUCTURE) or _is_large(item) for item in objects]
    row = np.where(large, np.cumsum(large) - 1, -1)
    surfaces = [_visibility(item, scan.views, rng) for item, used in zip(objects, large, strict=True) if used]
    return RoomPack(
        points=_steps(scan.points[chosen]),
        instance=scan.instance[chosen].astype(np.int16),
        point_offsets=np.array([0, len(chosen)], dtype=np.int64),
        object_offsets=np.array([0, len(objects)], dtype=np.int64),
        scanner=np.array([scan.scanner]),
        seed=np.array([seed], dtype=np.int64),
        name=np.array([item.name for item in objects], dtype=str),
        category=np.array([item.category for item in objects], dtype=str),
        pose=np.stack([item.pose for item in objects]).astype(np.float32),
        box=np.stack([item.box for item in objects]).astype(np.float32),
        surface_row=row.astype(np.int32),
        surface=_stacked([cloud for cloud, _, _ in surfaces], (SURFACE_POINTS, 3), np.int16),
        seen=_stacked([seen for _, seen, _ in surfaces], (SURFACE_POINTS // 8,), np.uint8),
        grid=_stacked([grid for _, _, grid in surfaces], (GRID**3 // 8,), np.uint8),
    )


def grid_nodes(box: np.ndarray) -> np.ndarray:
    """Return the nodes (GRID ** 3, 3) of the visibility grid about a box (2, 3); x varies slowest."""
    middle, half = box.mean(axis=0), float(np.ptp(box, axis=0).max()) / 2
    steps = np.linspace(-GRID_REACH * half, GRID_REACH * half, GRID)
    return np.asarray(np.stack(np.meshgrid(steps, steps, steps, indexing="ij"), axis=-1).reshape(-1, 3) + middle)


def _stacked(arrays: list[np.ndarray], shape: tuple[int, ...], kind: type) -> np.ndarray:
    return np.stack(arrays) if arrays else np.zeros((0, *shape), kind)


def _is_large(item: RoomObject) -> bool:
    return item.category == OTHER and float(np.ptp(item.box, axis=0).max()) >= LARGE


def _visibility(item: RoomObject, views: Views, rng: np.random.Generator) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return the whole surface (int16), and packed visibility bits of it and of the nodes around it."""
    cloud = _sampled(item.mesh, SURFACE_POINTS, rng)
    places = np.concatenate([cloud, grid_nodes(item.box)]) @ item.pose[:3, :3].T + item.pose[:3, 3]
    tolerance = SEEN_TOLERANCE * float(np.ptp(item.box, axis=0).max()) / 2
    seen = views.sees(places, np.full(len(places), tolerance))
    return _steps(cloud), np.packbits(seen[:SURFACE_POINTS]), np.packbits(seen[SURFACE_POINTS:])


def _sampled(mesh: Mesh, count: int, rng: np.random.Generator) -> np.ndarray:
    """Sample points (count, 3) of a mesh, uniform by area, in random order."""
    corners = np.asarray(mesh.vertices, dtype=np.float64)[np.asarray(mesh.faces)]
    areas = np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1)
    face = rng.choice(len(corners), size=count, p=areas / areas.sum())
    u, v = np.sort(rng.random((2, count)), axis=0)[:, :, None]
    a, b, c = corners[face].transpose(1, 0, 2)
    return np.asarray(a * u + b * (v - u) + c * (1 - v))


def _steps(points: np.ndarray) -> np.ndarray:
    return np.clip(np.round(np.asarray(points) / UNIT), -32767, 32767).astype(np.int16)
