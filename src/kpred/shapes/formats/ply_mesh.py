"""Vertices, polygons and triangle strips of PLY files."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from kpred.errors import MeshError
from kpred.ops.typing import Float, Int
from kpred.shapes.formats.geometry import Geometry
from kpred.shapes.formats.ply_elements import Columns, PlyLists, read_ply_elements
from kpred.shapes.formats.ply_header import read_ply_header
from kpred.shapes.formats.polygon import triangulate


def read_ply_mesh(path: Path) -> Geometry:
    """Read vertices, and triangles of faces and strips, all of one part.

    Raises:
        MeshError: no vertices with x, y and z, or a face names a vertex that does not exist.
        ScanError: damaged or cut short.
    """
    elements = read_ply_elements(path, read_ply_header(path))
    vertices = ply_positions(elements.get("vertex", {}), path)
    corners, sizes = _indices(elements.get("face", {}), path)
    if len(corners) and (corners.min() < 0 or corners.max() >= len(vertices)):
        raise MeshError(f"{path}: a face names a vertex that does not exist; export the mesh again.")
    faces, _ = triangulate(vertices, corners, sizes)
    strips, lengths = _indices(elements.get("tristrips", {}), path)
    if not len(strips):
        return Geometry(vertices, faces, np.zeros(len(faces), dtype=np.int64))
    if strips.max() >= len(vertices) or strips.min() < -1:
        raise MeshError(f"{path}: a strip names a vertex that does not exist; export the mesh again.")
    cut = strip_triangles(np.insert(strips, np.cumsum(lengths), -1))
    faces = np.concatenate([faces, cut])
    return Geometry(vertices, faces, np.zeros(len(faces), dtype=np.int64))


def ply_positions(columns: Columns, path: Path) -> Float[np.ndarray, "vertices 3"]:
    """Return the properties x, y and z, (V, 3) float64.

    Raises:
        MeshError: they are not there.
    """
    axes = [columns.get(axis) for axis in "xyz"]
    if any(not isinstance(axis, np.ndarray) for axis in axes):
        raise MeshError(f"{path}: it has no vertices with x, y and z; export it with coordinates.")
    return np.stack([np.asarray(axis, dtype=np.float64) for axis in axes], axis=1)


def strip_triangles(indices: np.ndarray) -> Int[np.ndarray, "faces 3"]:
    """Convert indices (N,) of triangle strips, each ended by -1, to triangles (F, 3) of one winding."""
    if len(indices) < 3:
        return np.zeros((0, 3), dtype=np.int64)
    corners = np.stack([indices[:-2], indices[1:-1], indices[2:]], axis=1)
    ends = np.flatnonzero(indices == -1)
    begins = np.concatenate([[0], ends + 1])
    places = np.arange(len(corners))
    # Every second triangle of a strip winds the other way.
    odd = (places - begins[np.searchsorted(ends, places)]) % 2 == 1
    corners[odd] = corners[odd][:, [1, 0, 2]]
    a, b, c = corners.T
    return corners[(corners >= 0).all(axis=1) & (a != b) & (b != c) & (c != a)]


def _indices(columns: Columns, path: Path) -> tuple[np.ndarray, np.ndarray]:
    """Return vertex indices of faces or strips, concatenated, and the size of each."""
    lists = {name: column for name, column in columns.items() if isinstance(column, PlyLists)}
    for name in ("vertex_indices", "vertex_index", *lists):
        if name in lists:
            found = lists[name]
            if (
                found.values.dtype.kind == "f"
                and not (np.isfinite(found.values) & (np.abs(found.values) < 2**53)).all()
            ):
                raise MeshError(f"{path}: a face names a vertex that does not exist; export the mesh again.")
            return found.values.astype(np.int64), found.sizes
    return np.zeros(0, dtype=np.int64), np.zeros(0, dtype=np.int64)
