"""Positions, faces and parts of Wavefront OBJ files.

Only geometry is read: materials and textures are skipped, so a missing .mtl does not matter, and a vertex stays one
vertex whatever its normals and texture coordinates. Relative (negative) indices count from the line they stand on.
"""

from __future__ import annotations

from array import array
from collections.abc import Iterable, Iterator
from pathlib import Path

import numpy as np

from kpred.errors import MeshError
from kpred.shapes.formats.geometry import Geometry
from kpred.shapes.formats.polygon import triangulate
from kpred.shapes.formats.records import number_of
from kpred.shapes.formats.text_lines import open_lines

_MAX_INDEX = 2**62
"""Beyond it the index of a vertex does not fit into 64 bits."""


def read_obj(path: Path) -> Geometry:
    """Read an OBJ file, with polygons cut into triangles.

    A part is a pair of ``o`` and ``g`` names, numbered in order of first use.

    Raises:
        MeshError: a line is damaged or names a vertex that does not exist.
    """
    coordinates = array("d")
    corners = array("q")
    sizes = array("q")
    parts = array("q")
    numbers: dict[tuple[bytes, bytes], int] = {}
    object_name = group_name = b""
    part = -1
    number = 0
    with open_lines(path) as stream:
        try:
            for number, line in _logical_lines(stream):  # noqa: B007 (the message below names it)
                if line.startswith((b"v ", b"V ")):
                    x, y, z = line.split(None, 4)[1:4]
                    coordinates.extend((number_of(x), number_of(y), number_of(z)))
                elif line.startswith((b"f ", b"fo ", b"F ")):
                    words = line.split()[1:]
                    if len(words) < 3:
                        continue
                    count = len(coordinates) // 3
                    for word in words:
                        index = _index(word.split(b"/", 1)[0])
                        if index == 0 or index < -count or index > _MAX_INDEX:
                            raise ValueError("no such vertex")
                        index = index - 1 if index > 0 else count + index
                        corners.append(index)
                    if part < 0:
                        part = numbers.setdefault((object_name, group_name), len(numbers))
                    sizes.append(len(words))
                    parts.append(part)
                elif line.startswith(b"o"):
                    object_name, part = line[1:].strip(), -1
                elif line.startswith((b"g ", b"g\n", b"g\r")):
                    group_name, part = line[1:].strip(), -1
                elif b"\x00" in line:
                    raise MeshError(f"{path}: it is not a text file; export the mesh as a text OBJ.")
        except ValueError as error:
            raise MeshError(f"{path}: line {number} is not a proper OBJ line; export the mesh again.") from error
    vertices = np.array(coordinates, dtype=np.float64).reshape(-1, 3)
    indices = np.array(corners, dtype=np.int64)
    if len(indices) and indices.max() >= len(vertices):
        raise MeshError(f"{path}: a face names a vertex that is not there (file cut short?); export the mesh again.")
    faces, polygon = triangulate(vertices, indices, np.array(sizes, dtype=np.int64))
    return Geometry(vertices, faces, np.array(parts, dtype=np.int64)[polygon])


def obj_lines(vertices: np.ndarray, faces: np.ndarray, parts: np.ndarray | None, digits: int = 9) -> Iterator[str]:
    """Yield the lines of an OBJ file; nine digits give float32 back exactly. Each part becomes an object."""
    for x, y, z in vertices.tolist():
        yield f"v {x:.{digits}g} {y:.{digits}g} {z:.{digits}g}\n"
    groups: Iterable[tuple[str, np.ndarray]] = [("", faces)]
    if parts is not None:
        groups = [(f"o part_{part}\n", faces[parts == part]) for part in np.unique(parts)]
    for header, rows in groups:
        yield header
        for a, b, c in (rows + 1).tolist():
            yield f"f {a} {b} {c}\n"


def _index(word: bytes) -> int:
    """Parse the number of a vertex, which some programs write as 7.0."""
    try:
        return int(word)
    except ValueError:
        number = float(word)
        if not number.is_integer():
            raise
        return int(number)


def _logical_lines(stream: Iterable[bytes]) -> Iterator[tuple[int, bytes]]:
    """Yield lines with their numbers, without leading blanks and comments; a backslash joins the next line."""
    held: list[bytes] = []
    for number, raw in enumerate(stream, start=1):
        line = raw.partition(b"#")[0] + b"\n" if b"#" in raw and not raw.startswith((b"o", b"g", b"m", b"u")) else raw
        if held or line[:1].isspace():
            line = line.lstrip()
        if line.endswith((b"\\\n", b"\\\r\n")):
            held.append(line.rstrip(b"\r\n")[:-1])
            continue
        if held:
            line, held = b" ".join([*held, line]), []
        yield number, line.replace(b"\t", b" ", 1) if b"\t" in line else line
