"""Positions and faces of OFF files (Object File Format, text), in lines or in free form."""

from __future__ import annotations

import re
from array import array
from collections.abc import Iterable, Iterator
from pathlib import Path

import numpy as np

from kpred.errors import MeshError
from kpred.ops.typing import Float, Int
from kpred.shapes.formats.polygon import triangulate
from kpred.shapes.formats.records import number_of
from kpred.shapes.formats.text_lines import open_lines

_KEYWORD = re.compile(rb"(ST)?C?N?(4)?(n)?OFF", re.IGNORECASE)

_Parsed = tuple["array[float]", "array[int]", "array[int]"]
"""Coordinates, corners of all faces, corners of each face."""


def read_off(path: Path) -> tuple[Float[np.ndarray, "vertices 3"], Int[np.ndarray, "faces 3"]]:
    """Read (V, 3) float64 vertices and (F, 3) int64 triangles; normals and colours are skipped.

    As Geomview describes it: the keyword may be missing, and any white space separates numbers. Files of one vertex or
    face a line may hold colours behind each; others may not.

    Raises:
        MeshError: not a text OFF file, or cut short.
    """
    with open_lines(path) as stream:
        lines = list(_content(stream))
    first = lines[0] if lines else b""
    keyword = _KEYWORD.match(first)
    if b"\x00" in first or b"BINARY" in first.upper() or not (keyword or _is_counts(first)):
        raise MeshError(f"{path}: it is not a text OFF file; export the mesh as text OFF or .ply.")
    if keyword and (keyword.group(2) or keyword.group(3)):
        raise MeshError(f"{path}: its points do not have three coordinates (4OFF, nOFF); export it as plain OFF.")
    # Some writers put the counts on the line of the keyword.
    rest = first[keyword.end() :].strip() if keyword else first
    body = ([rest] if rest else []) + lines[1:]
    try:
        try:
            coordinates, corners, sizes = _by_line(body)
        except (IndexError, ValueError):
            coordinates, corners, sizes = _free_form(body)
    except (IndexError, ValueError, OverflowError) as error:
        raise MeshError(f"{path}: the OFF file is damaged or cut short; export the mesh again.") from error
    vertices = np.array(coordinates, dtype=np.float64).reshape(-1, 3)
    indices = np.array(corners, dtype=np.int64)
    if len(indices) and (indices.min() < 0 or indices.max() >= len(vertices)):
        raise MeshError(f"{path}: a face names a vertex that does not exist; export the mesh again.")
    return vertices, triangulate(vertices, indices, np.array(sizes, dtype=np.int64))[0]


def off_lines(vertices: np.ndarray, faces: np.ndarray, digits: int = 9) -> Iterator[str]:
    """Yield the lines of an OFF file; nine digits give float32 back exactly."""
    yield f"OFF\n{len(vertices)} {len(faces)} 0\n"
    for x, y, z in vertices.tolist():
        yield f"{x:.{digits}g} {y:.{digits}g} {z:.{digits}g}\n"
    for a, b, c in faces.tolist():
        yield f"3 {a} {b} {c}\n"


def _by_line(lines: list[bytes]) -> _Parsed:
    vertex_count, face_count = _counts(lines[0].split(), len(lines))
    coordinates, corners, sizes = array("d"), array("q"), array("q")
    for line in lines[1 : vertex_count + 1]:
        x, y, z = line.split(None, 3)[:3]
        coordinates.extend((number_of(x), number_of(y), number_of(z)))
    for line in lines[vertex_count + 1 : vertex_count + 1 + face_count]:
        words = line.split()
        size = int(words[0])
        if size < 0 or len(words) <= size:
            raise ValueError("fewer corners than announced")
        sizes.append(size)
        corners.extend(map(int, words[1 : size + 1]))
    if len(sizes) < face_count:
        raise ValueError("fewer faces than announced")
    return coordinates, corners, sizes


def _free_form(lines: list[bytes]) -> _Parsed:
    """Parse numbers separated by any white space; all of them must be used."""
    words = b" ".join(lines).split()
    vertex_count, face_count = _counts(words, len(words))
    at = 3 + 3 * vertex_count
    coordinates = array("d", map(number_of, words[3:at]))
    corners, sizes = array("q"), array("q")
    for _ in range(face_count):
        size = int(words[at])
        if not 0 <= size < len(words) - at:
            raise ValueError("fewer corners than announced")
        sizes.append(size)
        corners.extend(map(int, words[at + 1 : at + 1 + size]))
        at += size + 1
    if at != len(words) or len(coordinates) < 3 * vertex_count:
        raise ValueError("another number of words than announced")
    return coordinates, corners, sizes


def _counts(words: list[bytes], available: int) -> tuple[int, int]:
    vertex_count, face_count = int(words[0]), int(words[1])
    if vertex_count < 0 or face_count < 0 or vertex_count + face_count > available:
        raise ValueError("more vertices and faces than there are numbers")
    return vertex_count, face_count


def _is_counts(line: bytes) -> bool:
    words = line.split()
    return len(words) >= 3 and all(word.isdigit() for word in words[:3])


def _content(stream: Iterable[bytes]) -> Iterator[bytes]:
    for raw in stream:
        line = raw.split(b"#", 1)[0].strip()
        if line:
            yield line
