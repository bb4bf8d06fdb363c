"""Points of PLY files: ascii, binary little-endian and binary big-endian."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import islice
from pathlib import Path

import numpy as np

from kpred.errors import ScanError
from kpred.shapes.formats.ply_elements import read_ply_elements
from kpred.shapes.formats.ply_header import PlyElement, PlyHeader
from kpred.shapes.formats.ply_mesh import ply_positions
from kpred.shapes.formats.records import BLOCK_ROWS, binary_records, text_records, truncated


def ply_points(path: Path, header: PlyHeader) -> Iterator[np.ndarray]:
    """Yield (n, 3) float64 blocks of the vertices of a PLY file; other properties are ignored.

    Memory does not grow with the file, unless lists stand in or before the vertices.

    Raises:
        ScanError: no vertices with x, y and z, or the file is cut short.
    """
    vertex = header.element("vertex")
    if vertex is None or not vertex.count or not {"x", "y", "z"} <= set(vertex.names):
        raise ScanError(f"{path}: it has no vertices with x, y and z; give a scan with at least 64 points.")
    before = header.elements[: header.elements.index(vertex)]
    if any(element.has_lists for element in (*before, vertex)) or header.lone_returns:
        points = ply_positions(read_ply_elements(path, header)["vertex"], path)
        for start in range(0, len(points), BLOCK_ROWS):
            yield points[start : start + BLOCK_ROWS]
        return
    if header.order == "":
        yield from _text_points(path, header, before, vertex)
        return
    skipped = sum(element.dtype(header.order).itemsize * element.count for element in before)
    if header.start + skipped > path.stat().st_size:
        raise truncated(str(path), 0, vertex.count)
    with open(path, "rb") as stream:
        stream.seek(header.start + skipped)
        yield from binary_records(stream, vertex.dtype(header.order), vertex.count, str(path))


def _text_points(
    path: Path, header: PlyHeader, before: tuple[PlyElement, ...], vertex: PlyElement
) -> Iterator[np.ndarray]:
    skipped = sum(element.count for element in before)
    if skipped + vertex.count > path.stat().st_size:  # A record takes at least one byte.
        raise truncated(str(path), 0, vertex.count)
    columns = (vertex.names.index("x"), vertex.names.index("y"), vertex.names.index("z"))
    found = 0
    with open(path, "rb") as stream:
        stream.seek(header.start)
        lines = islice(stream, skipped, skipped + vertex.count)
        for rows in text_records(lines, columns, str(path), header.lines + skipped + 1):
            found += len(rows)
            yield rows
    if found < vertex.count:
        raise truncated(str(path), found, vertex.count)
