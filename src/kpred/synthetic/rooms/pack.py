"""Many scanned rooms in one npz file: points with instances; objects with categories, poses, boxes, visibility."""

from __future__ import annotations

import dataclasses
import os
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple

import numpy as np

from kpred.atomic import atomic_path
from kpred.errors import PackError
from kpred.shapes.reading import check_file, reading

UNIT = 0.0005
"""Metres a step of the int16 coordinates: rooms of up to 32 m, to a quarter of a millimetre."""

SURFACE_POINTS = 2048
"""Points of each whole surface."""

GRID = 24
"""Nodes of a visibility grid along a side."""

GRID_REACH = 1.25
"""Half side of a visibility grid, in half longest sides of the object's box, about the middle of that box."""


class RoomPoints(NamedTuple):
    """Points (N, 3) float of one room in metres, their instances (N,), and the rows of its objects in the pack."""

    points: np.ndarray
    instance: np.ndarray
    objects: slice


@dataclass(frozen=True, eq=False)
class RoomPack:
    """Scanned rooms one after the other; room i owns rows offsets[i] .. offsets[i + 1] - 1.

    Attributes:
        points: (P, 3) int16, steps of `UNIT`, in the room's frame: y up, floor at y = 0.
        instance: (P,) int16 object of the room that a point was measured on, -1 for none.
        point_offsets, object_offsets: (R + 1,) int64.
        scanner: (R,) str, one of `kpred.synthetic.rooms.scan.SCANNERS`.
        seed: (R, 2) int64 seed and index of the room.
        name, category: (O,) str; the category is chair, table, cabinet, other or structure.
        pose: (O, 4, 4) float32 from the object's frame to the room's, metres.
        box: (O, 2, 3) float32 corners of the whole object's box in its own frame, metres.
        surface_row: (O,) int32 row of the object in the three arrays below, -1 where it has none (structure, clutter).
        surface: (S, SURFACE_POINTS, 3) int16 points of the whole surface, steps of `UNIT`, in the object's frame.
        seen: (S, SURFACE_POINTS / 8) uint8, packed bits: whether the scanner saw the surface point.
        grid: (S, GRID ** 3 / 8) uint8, packed bits, x by y by z: whether surface at a node would have been seen.

    Raises:
        PackError: the arrays do not fit together.
    """

    points: np.ndarray
    instance: np.ndarray
    point_offsets: np.ndarray
    object_offsets: np.ndarray
    scanner: np.ndarray
    seed: np.ndarray
    name: np.ndarray
    category: np.ndarray
    pose: np.ndarray
    box: np.ndarray
    surface_row: np.ndarray
    surface: np.ndarray
    seen: np.ndarray
    grid: np.ndarray

    def __post_init__(self) -> None:
        rooms, objects, surfaces = len(self.scanner), len(self.name), len(self.surface)
        shapes = {
            "points": (len(self.points), 3),
            "instance": (len(self.points),),
            "point_offsets": (rooms + 1,),
            "object_offsets": (rooms + 1,),
            "seed": (rooms, 2),
            "category": (objects,),
            "pose": (objects, 4, 4),
            "box": (objects, 2, 3),
            "surface_row": (objects,),
            "surface": (surfaces, SURFACE_POINTS, 3),
            "seen": (surfaces, SURFACE_POINTS // 8),
            "grid": (surfaces, GRID**3 // 8),
        }
        for key, shape in shapes.items():
            if getattr(self, key).shape != shape:
                raise PackError(f"{key} of a room pack must have shape {shape}; write the pack again.")
        for key, total in (("point_offsets", len(self.points)), ("object_offsets", objects)):
            offsets = getattr(self, key)
            if offsets[0] != 0 or offsets[-1] != total or (np.diff(offsets) < 0).any():
                raise PackError(f"{key} of a room pack must rise from 0 to {total}; write the pack again.")
        most = np.repeat(np.diff(self.object_offsets), np.diff(self.point_offsets))
        if ((self.instance < -1) | (self.instance >= most)).any() or (self.surface_row >= surfaces).any():
            raise PackError("A point of a room pack names an object that is not there; write the pack again.")

    def __len__(self) -> int:
        return len(self.scanner)

    def room(self, index: int) -> RoomPoints:
        """Return one room; its points are float32, y up."""
        rows = slice(int(self.point_offsets[index]), int(self.point_offsets[index + 1]))
        objects = slice(int(self.object_offsets[index]), int(self.object_offsets[index + 1]))
        points = self.points[rows].astype(np.float32) * np.float32(UNIT)
        return RoomPoints(points, self.instance[rows], objects)

    def save(self, path: str | os.PathLike[str]) -> None:
        """Write the pack as a compressed npz, whole or not at all.

        Raises:
            OutputError: the file cannot be written there.
        """
        arrays = {field.name: getattr(self, field.name) for field in dataclasses.fields(self)}
        with atomic_path(path) as temporary, open(temporary, "xb") as stream:
            np.savez_compressed(stream, **arrays)

    @classmethod
    def load(cls, path: str | os.PathLike[str]) -> RoomPack:
        """Read a pack.

        Raises:
            PackError: the file is missing, damaged, or no room pack.
        """
        file = Path(path)
        check_file(file, PackError, ".npz file of a room pack")
        names = [field.name for field in dataclasses.fields(cls)]
        with reading(file, PackError):
            try:
                with np.load(file, allow_pickle=False) as arrays:
                    found = {name: arrays[name] for name in names}
            except KeyError as error:
                raise PackError(
                    f"{file}: it is not a room pack, it lacks {error}; make one by `kpred data rooms`."
                ) from error
            except Exception as error:  # A parser of foreign bytes may fail in any way.
                raise PackError(
                    f"{file}: it is not a readable .npz file (damaged or cut short); copy it again."
                ) from error
        try:
            return cls(**found)
        except PackError as error:
            raise PackError(f"{file}: {error}") from error


def concatenate_rooms(packs: Sequence[RoomPack]) -> RoomPack:
    """Join packs, their rooms in order.

    Raises:
        PackError: there is none.
    """
    if not packs:
        raise PackError("There is no room pack to concatenate; give at least one.")
    joined = {}
    for field in dataclasses.fields(RoomPack):
        arrays = [getattr(pack, field.name) for pack in packs]
        if field.name.endswith("_offsets"):
            sizes = np.concatenate([np.diff(array) for array in arrays])
            joined[field.name] = np.concatenate([[0], np.cumsum(sizes)]).astype(np.int64)
        elif field.name == "surface_row":
            starts = np.cumsum([0, *(len(pack.surface) for pack in packs)])
            moved = [np.where(a < 0, -1, a + start) for a, start in zip(arrays, starts, strict=False)]
            joined[field.name] = np.concatenate(moved).astype(np.int32)
        else:
            joined[field.name] = np.concatenate(arrays)
    return RoomPack(**joined)
