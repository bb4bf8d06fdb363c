"""Rooms with the true object of each point: real ones with labels, and virtual ones of room packs."""

from __future__ import annotations

import json
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from kpred.detection.networks import CATEGORIES
from kpred.errors import ScanError
from kpred.evaluation.rooms.poses import TruePose, true_poses
from kpred.evaluation.rooms.virtual import room_rotation, upright_room
from kpred.scenes.scene import Scene, read_scene
from kpred.shapes.reading import reading
from kpred.synthetic.rooms.pack import RoomPack

FURNITURE = {
    "chair": "chair",
    "table": "table",
    "desk": "table",
    "cabinet": "cabinet",
    "shelves": "cabinet",
    "bookshelf": "cabinet",
    "bookcase": "cabinet",
    "nightstand": "cabinet",
    "dresser": "cabinet",
}
"""Categories of the names that labels give."""

UNNAMED = ("", "clutter", "otherprop", "otherfurniture", "otherstructure", "other")
"""Names that furniture may hide under: what is found there is neither right nor wrong."""

MIN_POINTS = 100
"""Points of an object that must be seen for it to count."""


@dataclass(frozen=True, eq=False)
class LabelledRoom:
    """A room with its true objects.

    Attributes:
        dataset: where it comes from; scene: its points.
        instance: (N,) row of each point in `categories`, -1 for none.
        categories: chair, table, cabinet, `other`, or "" where the labels do not say.
        poses: of the furniture, where they are known.
    """

    dataset: str
    scene: Scene
    instance: np.ndarray
    categories: tuple[str, ...]
    poses: tuple[TruePose, ...] = ()


def labelled_rooms(path: Path, limit: int | None = None) -> Iterator[LabelledRoom]:
    """Read labelled rooms: of a room pack (.npz), or of a folder of NAME.ply, .instances.npy and .names.json.

    Raises:
        ScanError: there are none, or their files do not fit together.
        PackError: the pack is damaged.
    """
    rooms = _of_pack(path) if path.suffix.lower() == ".npz" else _of_folder(path)
    for number, room in enumerate(rooms):
        if limit is not None and number >= limit:
            return
        yield room


def _of_pack(path: Path) -> Iterator[LabelledRoom]:
    pack = RoomPack.load(path)
    for index in range(len(pack)):
        yaw = float(np.random.default_rng([index, 17]).uniform(0, 2 * np.pi))
        points, instance, objects = upright_room(pack, index, yaw)
        names = pack.category[objects].tolist()
        categories = tuple("other" if name == "structure" else str(name) for name in names)
        scene = Scene(points, name=f"{path.stem}_{index:03d}_{pack.scanner[index]}")
        poses = true_poses(pack, objects, room_rotation(yaw), CATEGORIES)
        yield LabelledRoom(path.stem, scene, instance.astype(np.int64), categories, poses)


def _of_folder(folder: Path) -> Iterator[LabelledRoom]:
    files = sorted(folder.glob("*.names.json"))
    if not files:
        raise ScanError(
            f"{folder}: it has no NAME.ply with NAME.instances.npy and NAME.names.json; add labelled rooms."
        )
    for file in files:
        name = file.name.removesuffix(".names.json")
        scene = read_scene(folder / f"{name}.ply")
        labels = folder / f"{name}.instances.npy"
        with reading(labels, ScanError):
            instance = np.load(labels, allow_pickle=False).astype(np.int64)
        if instance.shape != (len(scene.points),):
            raise ScanError(
                f"{labels}: it labels {instance.size} points of {len(scene.points)}; give those of the room."
            )
        with reading(file, ScanError):
            names: Sequence[str] = json.loads(file.read_text(encoding="utf-8"))
        categories = tuple(FURNITURE.get(one, "" if one in UNNAMED else "other") for one in names)
        yield LabelledRoom(folder.name, scene, np.where(instance > 0, instance, -1), categories)


def true_objects(room: LabelledRoom) -> dict[int, str]:
    """Return rows and categories of the objects that the scan shows, structure and clutter included."""
    counts = np.bincount(room.instance[room.instance >= 0], minlength=len(room.categories))
    return {row: name for row, name in enumerate(room.categories) if counts[row] >= MIN_POINTS}
