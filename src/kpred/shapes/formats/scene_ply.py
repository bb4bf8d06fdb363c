"""The records of a scene's PLY file with all their properties: labels, instances and colours of vertices and faces."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from kpred.errors import ScanError
from kpred.shapes.formats.ply_elements import Columns, PlyLists, read_ply_elements
from kpred.shapes.formats.ply_header import read_ply_header


def scene_elements(path: Path) -> dict[str, Columns]:
    """Read all elements of a scene's PLY file; the vertices have x, y and z.

    Raises:
        ScanError: not a PLY file, without vertices that have x, y and z, or cut short.
    """
    elements = read_ply_elements(path, read_ply_header(path))
    vertices = plain_columns(elements.get("vertex", {}))
    if not vertices or not len(next(iter(vertices.values()))):
        raise ScanError(f"{path}: it has no vertices; give the PLY of a scanned scene.")
    if not {"x", "y", "z"} <= set(vertices):
        raise ScanError(f"{path}: its vertices have no x, y and z; give the PLY of a scanned scene.")
    return elements


def vertex_columns(path: Path) -> dict[str, np.ndarray]:
    """Read every property of the vertices that is no list, each (N,), of the file's types (float64 for ascii files).

    Raises:
        ScanError: missing, not a PLY file, without vertices that have x, y and z, or cut short.
    """
    try:
        return plain_columns(scene_elements(path)["vertex"])
    except OSError as error:
        raise ScanError(f"{path}: it cannot be read ({error.strerror or error}); check the path.") from error


def plain_columns(columns: Columns) -> dict[str, np.ndarray]:
    """Return the properties that hold one number a record."""
    return {name: column for name, column in columns.items() if not isinstance(column, PlyLists)}
