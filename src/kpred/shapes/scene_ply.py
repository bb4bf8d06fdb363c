"""The vertices of a PLY file with all their properties: labels, instances and colours of scanned scenes."""

from __future__ import annotations

from itertools import islice
from pathlib import Path

import numpy as np

from kpred.errors import ScanError
from kpred.shapes.records import truncated
from kpred.shapes.scan_ply import read_ply_header


def vertex_columns(path: Path) -> dict[str, np.ndarray]:
    """Every property of the vertices, in the file's order and types (float64 for ascii files), each (N,).

    Raises:
        ScanError: missing, not a PLY file, without vertices that have x, y and z, or cut short.
    """
    try:
        header = read_ply_header(path)
        at = next((i for i, element in enumerate(header.elements) if element.name == "vertex"), None)
        if at is None or not header.elements[at].count:
            raise ScanError(f"{path}: it has no vertices; give the PLY of a scanned scene.")
        vertex, before = header.elements[at], header.elements[:at]
        names = [name for name, _ in vertex.properties]
        if not {"x", "y", "z"} <= set(names):
            raise ScanError(f"{path}: its vertices have no x, y and z; give the PLY of a scanned scene.")
        if any(kind is None for element in [*before, vertex] for _, kind in element.properties):
            raise ScanError(f"{path}: lists stand among or before its vertices; export it with plain properties.")
        with open(path, "rb") as stream:
            stream.seek(header.start)
            if header.order == "":
                skipped = sum(element.count for element in before)
                lines = [line.split() for line in islice(stream, skipped, skipped + vertex.count)]
                try:
                    table = np.array(lines, dtype=np.float64)
                except ValueError:
                    raise ScanError(f"{path}: a vertex has too few or no numbers; export the scene again.") from None
                if table.shape != (vertex.count, len(names)):
                    raise truncated(str(path), len(lines), vertex.count)
                return {name: table[:, column] for column, name in enumerate(names)}
            for element in before:
                dtype = element.dtype(header.order)
                assert dtype is not None
                stream.seek(dtype.itemsize * element.count, 1)
            dtype = vertex.dtype(header.order)
            assert dtype is not None
            data = stream.read(dtype.itemsize * vertex.count)
    except OSError as error:
        raise ScanError(f"{path}: it cannot be read ({error.strerror or error}); check the path.") from error
    if len(data) < dtype.itemsize * vertex.count:
        raise truncated(str(path), len(data) // dtype.itemsize, vertex.count)
    rows = np.frombuffer(data, dtype=dtype, count=vertex.count)
    return {name: rows[name].astype(rows[name].dtype.newbyteorder("=")) for name in names}
