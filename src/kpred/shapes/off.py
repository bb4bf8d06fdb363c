"""Positions and faces of OFF files (Object File Format, text)."""

from __future__ import annotations

from array import array
from collections.abc import Iterable, Iterator
from pathlib import Path

import numpy as np

from kpred.errors import MeshError
from kpred.shapes.polygon import triangulate


def read_off(path: Path) -> tuple[np.ndarray, np.ndarray]:
    """Read (V, 3) float64 vertices and (F, 3) int64 triangles; normals and colours are skipped.

    Raises:
        MeshError: not a text OFF file, or cut short.
    """
    with open(path, "rb") as stream:
        lines = _content(stream)
        first = next(lines, b"")
        kind, _, rest = first.partition(b"OFF")
        if first.find(b"OFF") < 0 or kind.strip(b"STCN") or b"BINARY" in rest:
            raise MeshError(f"{path}: it is not a text OFF file; export the mesh as text OFF or .ply.")
        try:
            # Some writers put the counts on the line of the keyword.
            counts = (rest.strip() or next(lines)).split()
            vertex_count, face_count = int(counts[0]), int(counts[1])
            coordinates = array("d")
            for _ in range(vertex_count):
                x, y, z = next(lines).split(None, 3)[:3]
                coordinates.extend((float(x), float(y), float(z)))
            corners, sizes = array("q"), array("q")
            for _ in range(face_count):
                words = next(lines).split()
                size = int(words[0])
                if size < 0 or len(words) <= size:
                    raise ValueError("fewer corners than announced")
                sizes.append(size)
                corners.extend(map(int, words[1 : size + 1]))
        except (StopIteration, ValueError, IndexError) as error:
            raise MeshError(f"{path}: the OFF file is damaged or cut short; export the mesh again.") from error
    vertices = np.array(coordinates, dtype=np.float64).reshape(-1, 3)
    indices = np.array(corners, dtype=np.int64)
    if len(indices) and (indices.min() < 0 or indices.max() >= len(vertices)):
        raise MeshError(f"{path}: a face names a vertex that does not exist; export the mesh again.")
    return vertices, triangulate(vertices, indices, np.array(sizes, dtype=np.int64))[0]


def off_lines(vertices: np.ndarray, faces: np.ndarray) -> Iterator[str]:
    """Yield the lines of an OFF file; nine digits give float32 back exactly."""
    yield f"OFF\n{len(vertices)} {len(faces)} 0\n"
    for x, y, z in vertices.tolist():
        yield f"{x:.9g} {y:.9g} {z:.9g}\n"
    for a, b, c in faces.tolist():
        yield f"3 {a} {b} {c}\n"


def _content(stream: Iterable[bytes]) -> Iterator[bytes]:
    for raw in stream:
        line = raw.split(b"#", 1)[0].strip()
        if line:
            yield line
