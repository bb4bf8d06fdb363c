"""Files of a whole scene, in every format of `kpred.exports` that holds several objects."""

from __future__ import annotations

import os
from collections import Counter
from pathlib import Path
from typing import TYPE_CHECKING

from kpred.atomic import write_together
from kpred.errors import OutputError
from kpred.exports.format_table import FORMATS, check_extension
from kpred.exports.formats import export_writers
from kpred.exports.furniture import WOOD, Export
from kpred.exports.writer import Writer
from kpred.fitting.export import furniture_of

if TYPE_CHECKING:
    from kpred.fitting.fit_scene import SceneFit

SCENE_EXTENSIONS = tuple(extension for extension, known in FORMATS.items() if known.rooms)
"""Suffixes of formats that hold several objects."""


def check_scene_file(path: str | os.PathLike[str]) -> Path:
    """Refuse a file that cannot hold a scene, before any work is done for it.

    Raises:
        OutputError: its format is unknown or holds one object, or a library of it is not installed.
    """
    file = Path(path)
    if file.suffix.lower() not in SCENE_EXTENSIONS:
        known = ", ".join(SCENE_EXTENSIONS)
        raise OutputError(f"Cannot write {file}: scenes are {known} files; give it one of these extensions.")
    check_extension(file)
    return file


def scene_export(room: SceneFit, density: float = WOOD) -> Export:
    """Return a scene as an export; its unit is that which most results were found to have.

    Args:
        density: kg per cubic metre, for simulations.

    Raises:
        OutputError: no object was fitted. DatabaseError: materials of a model cannot be read.
    """
    fits = {item.node: item.fit for item in room.fitted if item.fit is not None}
    if not fits:
        raise OutputError(f"{room.scene.name}: no object of the scene was fitted, so its file would be empty.")
    metres, _ = Counter(fit.unit.metres for fit in fits.values()).most_common(1)[0]
    objects = tuple(furniture_of(fit, name) for name, fit in fits.items())
    return Export(objects, room.scan_to_glb()[:3, :3], metres, density)


def scene_writers(room: SceneFit, path: Path) -> dict[Path, Writer]:
    """List the files of a scene with what writes each: `path` first, then what lies beside it (`STEM_*`).

    GLB holds the points that nothing explains too (`SceneFit.glb_scene`).

    Raises:
        OutputError: as `check_scene_file` and `scene_export`.
    """
    file = check_scene_file(path)
    if file.suffix.lower() == ".glb":
        return {file: room.to_glb}
    return export_writers(scene_export(room), file)


def save_scene(room: SceneFit, path: str | os.PathLike[str]) -> list[Path]:
    """Write the files of a scene, all of them or none, and return them.

    Raises:
        OutputError: as `scene_writers`, or a file cannot be written there.
    """
    writers = scene_writers(room, Path(path))
    write_together(writers)
    return list(writers)
