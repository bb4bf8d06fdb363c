"""Opening a room in studio: fitted anew, or with the corrections of a record."""

from __future__ import annotations

import os
from collections.abc import Callable
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any, get_args

from kpred.errors import ConfigError, ScanError
from kpred.fitting.fit_room import LevelRoom, fit_level_room
from kpred.fitting.fit_scene import fit_scene
from kpred.fitting.options import FitOptions
from kpred.fitting.raw_scan import is_room, read_raw_scan
from kpred.fitting.stages import Context, find_up
from kpred.ops.rotations import UP_AXES
from kpred.refinement.config import Deform
from kpred.scenes.objects import objects_of
from kpred.scenes.scene import read_scene
from kpred.shapes.unit_name import UNIT_NAMES
from kpred.studio.gestures import AUTO
from kpred.studio.room import RoomSession
from kpred.studio.room_record import read_room_record

Progress = Callable[[int, int, str], None]


@dataclass(frozen=True)
class RoomOptions:
    """How a room is fitted: `up`: its up axis, or auto; `deform`, `unit`: as for `kpred.fit`."""

    up: str = "auto"
    deform: str = "auto"
    unit: str = "auto"

    def __post_init__(self) -> None:
        known = {"up": (AUTO, *UP_AXES), "deform": get_args(Deform), "unit": (AUTO, *UNIT_NAMES)}
        for name, values in known.items():
            if getattr(self, name) not in values:
                raise ConfigError(f"{name} must be one of {', '.join(values)}, but is '{getattr(self, name)[:40]}'.")


@dataclass(frozen=True)
class RoomFiles:
    """Files of a room: its scan, and what names its objects; None: its own instance numbers, or what is found."""

    scan: Path
    objects: Path | None = None


def is_plainly_room(scan: str | os.PathLike[str], context: Context, options: FitOptions) -> bool:
    """Find out whether a scan is plainly a room.

    Raises:
        ScanError: it cannot be read.
    """
    raw = read_raw_scan(scan, options)
    return is_room(raw, find_up(raw, context, options), options)


def open_room(files: RoomFiles, context: Context, options: RoomOptions, progress: Progress | None) -> RoomSession:
    """Read a room and fit its objects: those that a file names, or those that are found.

    Raises:
        KpredError: it cannot be read, or no object of it could be fitted.
    """
    scene = read_scene(files.scan, None if options.up == "auto" else options.up)
    given: dict[str, Any] = {"deform": options.deform, "unit": options.unit}
    if files.objects is None and scene.instances is None:
        room = fit_level_room(scene, context.model, context.database, progress, options.up, **given)
    else:
        objects = objects_of(scene, files.objects)
        room = LevelRoom.of(fit_scene(scene, objects, context.model, context.database, progress, **given))
    if not any(item.fit is not None for item in room.fits):
        raise ScanError(f"{files.scan}: none of its {len(room.fits)} objects could be fitted; {room.fits[0].error}")
    named = None if files.objects is None else files.objects.name
    return RoomSession(room, files.scan.name, context, asdict(options), named)


def open_room_record(path: Path, files: RoomFiles | None, context: Context, progress: Progress | None) -> RoomSession:
    """Fit a room as a record says, and repeat its corrections.

    Args:
        files: where the room and what names its objects are; None: beside the record. No other file is read.

    Raises:
        KpredError: the record or the room cannot be read, or the room, the networks or the database are others.
    """
    record = read_room_record(path)
    beside = RoomFiles(
        path.with_name(record.scan), None if record.objects is None else path.with_name(record.objects)
    )  # fmt: skip
    found = beside if files is None else RoomFiles(files.scan, files.objects or beside.objects)
    for file in (found.scan, found.objects):
        if file is not None and not file.exists():
            raise ConfigError(f"{path}: {file.name} is not beside it; give it with --scan or --objects.")
    try:
        options = RoomOptions(**record.options)
    except TypeError as error:
        raise ConfigError(f"{path}: its options are not those of this version.") from error
    room = open_room(found, context, options, progress)
    record.check(room)
    record.replay(room)
    return room
