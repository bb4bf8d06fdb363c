"""Reading a furniture library of Sweet Home 3D: what its properties file says about every model.

A library is a zip archive with `PluginFurnitureCatalog.properties` (ISO 8859-1), one OBJ with its materials per model,
and licence texts. Models stand on the floor with y up and their front at +z after the rotation that the library gives.
"""

from __future__ import annotations

import re
import zipfile
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path, PurePosixPath

import numpy as np

from kpred.errors import MeshError
from kpred.ops.typing import Float
from kpred.shapes.reading import check_file, reading

PROPERTIES = "PluginFurnitureCatalog.properties"

MAX_BYTES = 1 << 28
"""Size of a single file in a library, expanded."""

_ENTRY = re.compile(r"^(\w+)#(\d+)[ \t]*=(.*)$", re.MULTILINE)
_HEADER = re.compile(r"^(\w+)[ \t]*=(.*)$", re.MULTILINE)
_ESCAPE = re.compile(r"\\u([0-9A-Fa-f]{4})")
_METRE = 0.01
"""Sizes are in centimetres."""


@dataclass(frozen=True, eq=False)
class LibraryModel:
    """One model of a library.

    Attributes:
        key: `library#model`, unique in all libraries of Sweet Home 3D.
        title, tags, room, author: as the library says; room is its category (`Living room`, `Office`, ...).
        obj: member of the archive.
        size: (3,) width, height and depth in metres.
        rotation: (3, 3) from the OBJ's coordinates to y up, front +z.
    """

    key: str
    title: str
    tags: str
    room: str
    author: str
    obj: str
    size: Float[np.ndarray, "3"]
    rotation: Float[np.ndarray, "3 3"]


@dataclass(frozen=True, eq=False)
class Library:
    """An open library: its models and the files beside them.

    Attributes:
        path: the archive; name, licence, version: as its properties say; models: in order.
    """

    path: Path
    archive: zipfile.ZipFile
    name: str
    licence: str
    version: str
    models: tuple[LibraryModel, ...]

    def read(self, member: str) -> bytes:
        """Read a file of the archive.

        Raises:
            MeshError: it is not there, or larger than `MAX_BYTES`.
        """
        try:
            size = self.archive.getinfo(member).file_size
        except KeyError as error:
            raise MeshError(f"{self.path}: it lacks {member}; install the package again.") from error
        if size > MAX_BYTES:
            raise MeshError(f"{self.path}: {member} expands to {size / 1e6:.0f} MB; leave this library out.")
        return self.archive.read(member)

    def beside(self, model: LibraryModel) -> list[str]:
        """List the members in the model's folder of the archive."""
        folder = str(PurePosixPath(model.obj).parent) + "/"
        return [name for name in self.archive.namelist() if name.startswith(folder) and not name.endswith("/")]


@contextmanager
def open_library(path: Path) -> Iterator[Library]:
    """Open a library (.sh3f) and read its properties.

    Raises:
        MeshError: it is missing, no archive, or has no properties of furniture.
    """
    check_file(path, MeshError, "furniture library (.sh3f)")
    with reading(path, MeshError, "furniture library (.sh3f)"), zipfile.ZipFile(path) as archive:
        if PROPERTIES not in archive.namelist():
            raise MeshError(f"{path}: it has no {PROPERTIES}; give a furniture library of Sweet Home 3D.")
        text = archive.read(PROPERTIES).decode("iso-8859-1")
        header = {key: _plain(value) for key, value in _HEADER.findall(text)}
        entries: dict[int, dict[str, str]] = {}
        for key, number, value in _ENTRY.findall(text):
            entries.setdefault(int(number), {})[key] = _plain(value)
        models = tuple(_model(entry, path) for _, entry in sorted(entries.items()))
        yield Library(
            path, archive, header.get("name", path.stem), header.get("license", ""), header.get("version", ""), models
        )


def _model(entry: Mapping[str, str], path: Path) -> LibraryModel:
    try:
        size = np.array([float(entry[key]) for key in ("width", "height", "depth")]) * _METRE
        numbers = entry.get("modelRotation", "1 0 0 0 1 0 0 0 1").split()
        rotation = np.array(numbers, dtype=np.float64).reshape(3, 3)
        obj = entry["model"].lstrip("/")
        key = entry["id"]
    except (KeyError, ValueError) as error:
        raise MeshError(f"{path}: an entry of its {PROPERTIES} is damaged ({error}); leave it out.") from error
    if not (np.isfinite(size).all() and (size > 0).all() and np.isfinite(rotation).all()):
        raise MeshError(f"{path}: the size or rotation of {key} is impossible; leave it out.")
    return LibraryModel(
        key,
        entry.get("name", ""),
        entry.get("tags", ""),
        entry.get("category", ""),
        entry.get("creator", ""),
        obj,
        size,
        rotation,
    )


def _plain(value: str) -> str:
    """Resolve the escapes of a properties file."""
    return _ESCAPE.sub(lambda found: chr(int(found[1], 16)), value).replace("\\:", ":").strip()
