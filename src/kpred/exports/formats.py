"""The table of formats: from the suffix of a file to what writes it."""

from __future__ import annotations

import os
from collections.abc import Callable
from dataclasses import dataclass
from importlib import import_module
from pathlib import Path

import numpy as np

from kpred.atomic import write_together
from kpred.errors import OutputError
from kpred.exports.furniture import Export
from kpred.exports.libraries import check_library
from kpred.exports.writer import Writer


@dataclass(frozen=True)
class Format:
    """A format of files.

    Attributes:
        module: of `kpred.exports` that writes it, with a function `MODULE_writers`; name: for people.
        library, extra: the Python module that it needs, and the extra of kpred that installs it; empty for none.
        rooms: whether it holds several objects.
    """

    module: str
    name: str
    library: str = ""
    extra: str = ""
    rooms: bool = True


_USD = Format("usd", "USD", "pxr", "usd")
FORMATS: dict[str, Format] = {
    ".obj": Format("surface", "Wavefront OBJ", rooms=False),
    ".ply": Format("surface", "PLY", rooms=False),
    ".glb": Format("glb", "binary glTF 2.0"),
    ".stl": Format("surface", "STL", rooms=False),
    ".off": Format("surface", "OFF", rooms=False),
    ".usd": _USD,
    ".usda": _USD,
    ".usdc": _USD,
    ".usdz": _USD,
    ".xml": Format("mjcf", "MJCF of MuJoCo"),
    ".mjcf": Format("mjcf", "MJCF of MuJoCo"),
    ".urdf": Format("urdf", "URDF"),
    ".sdf": Format("sdf", "SDF of Gazebo"),
    ".ifc": Format("ifc", "IFC4", "ifcopenshell", "bim"),
}

EXTENSIONS = tuple(FORMATS)
"""Suffixes of all formats, in lower case."""


def check_extension(path: str | os.PathLike[str]) -> Format:
    """Return the format of a file, before any work is done for it.

    Raises:
        OutputError: unknown extension, or the library of the format is not installed.
    """
    file = Path(path)
    found = FORMATS.get(file.suffix.lower())
    if found is None:
        known = ", ".join(EXTENSIONS)
        raise OutputError(f"Cannot write {file}: unknown extension {file.suffix!r}; use one of {known}.")
    if found.library:
        check_library(found.library, found.extra, file)
    return found


def export_writers(export: Export, path: str | os.PathLike[str]) -> dict[Path, Writer]:
    """List the files of an export with what writes each: `path` first, then what lies beside it (`STEM_*`).

    Raises:
        OutputError: unknown extension, a library is missing, the format holds one object alone, or a mesh is not
            finite.
        DatabaseError: the model's materials cannot be read.
    """
    file = Path(path)
    found = check_extension(file)
    if len(export.objects) > 1 and not found.rooms:
        raise OutputError(f"Cannot write {file}: {found.name} holds one object; use .glb, .usd, .xml or .ifc.")
    for one in export.objects:
        if not np.isfinite(one.vertices).all():
            raise OutputError(f"Cannot write {file}: the mesh has vertices that are NaN or infinite; fit it again.")
    module = import_module(f"kpred.exports.{found.module}")
    write: Callable[[Export, Path], dict[Path, Writer]] = getattr(module, f"{found.module}_writers")
    return write(export, file)


def save_export(export: Export, path: str | os.PathLike[str]) -> list[Path]:
    """Write the files of an export, all of them or none, and return them.

    Raises:
        OutputError: as `export_writers`, or a file cannot be written there.
    """
    writers = export_writers(export, path)
    write_together(writers)
    return list(writers)
