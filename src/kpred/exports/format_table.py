"""The table of formats: from the suffix of a file to what writes it; it loads none of them."""

from __future__ import annotations

import os
from dataclasses import dataclass
from pathlib import Path

from kpred.errors import OutputError
from kpred.exports.libraries import check_library


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
