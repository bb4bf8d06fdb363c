"""Cells of a grid that a mesh fills, by which volumes of meshes and of what they share are measured."""

from __future__ import annotations

import numpy as np
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components
from scipy.spatial import ConvexHull, QhullError

from kpred.ops.typing import Float, Int

CELL = 0.02
"""Default edge of a cell, in the mesh's unit."""

CONVEX = 0.6
"""A body that fills less of its convex hull than this is taken as a shell: its surface alone is solid."""


def solid_cells(
    vertices: Float[np.ndarray, "vertices 3"], faces: Int[np.ndarray, "faces 3"], cell: float = CELL
) -> Int[np.ndarray, "cells 3"]:
    """List the cells (C, 3), whole numbers, whose centres lie in a mesh: in the convex hulls of its bodies.

    A body is what faces join; one that is far from convex counts as a shell, one cell thick.
    """
    if not len(faces):
        return np.zeros((0, 3), dtype=np.int64)
    edges = np.concatenate([faces[:, :2], faces[:, 1:]])
    graph = coo_matrix((np.ones(len(edges)), (edges[:, 0], edges[:, 1])), shape=(len(vertices), len(vertices)))
    _, body = connected_components(_with_equal_places(graph, vertices), directed=False)
    parts = []
    of_face = body[faces[:, 0]]
    for number in np.unique(of_face):
        own = faces[of_face == number]
        parts.append(_body_cells(vertices, own, cell))
    return np.unique(np.concatenate(parts), axis=0)


def shared_cells(one: Int[np.ndarray, "cells 3"], other: Int[np.ndarray, "others 3"]) -> int:
    """Count the cells that both hold."""
    if not len(one) or not len(other):
        return 0
    low, high = np.maximum(one.min(axis=0), other.min(axis=0)), np.minimum(one.max(axis=0), other.max(axis=0))
    if (low > high).any():
        return 0
    size = high - low + 1
    codes = []
    for cells in (one, other):
        near = cells[((cells >= low) & (cells <= high)).all(axis=1)] - low
        codes.append((near[:, 0] * size[1] + near[:, 1]) * size[2] + near[:, 2])
    return len(np.intersect1d(codes[0], codes[1], assume_unique=True))


def _with_equal_places(graph: coo_matrix, vertices: np.ndarray) -> coo_matrix:
    """Join vertices at one place, of which meshes have several where normals or textures differ."""
    scale = max(float(np.ptp(vertices, axis=0).max()), 1e-12) * 1e-6
    _, place = np.unique(np.round(vertices / scale).astype(np.int64), axis=0, return_inverse=True)
    first = np.zeros(int(place.max()) + 1, dtype=np.int64)
    first[place] = np.arange(len(vertices))
    rows = np.concatenate([graph.row, np.arange(len(vertices))])
    columns = np.concatenate([graph.col, first[place]])
    return coo_matrix((np.ones(len(rows)), (rows, columns)), shape=graph.shape)


def _body_cells(vertices: np.ndarray, faces: np.ndarray, cell: float) -> np.ndarray:
    corners = vertices[np.unique(faces)]
    surface = _surface_cells(vertices, faces, cell)
    try:
        hull = ConvexHull(corners)
    except (QhullError, ValueError):  # Flat bodies have no inside.
        return surface
    a, b, c = (vertices[faces[:, k]] - corners[0] for k in range(3))
    volume = abs(float((a * np.cross(b, c)).sum())) / 6.0
    if volume < CONVEX * hull.volume:
        return surface
    low, high = (np.floor(corner / cell).astype(np.int64) for corner in (corners.min(axis=0), corners.max(axis=0)))
    axes = [np.arange(start, end + 1) for start, end in zip(low, high, strict=True)]
    cells = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 3)
    centres = (cells + 0.5) * cell
    equations = np.unique(np.round(hull.equations, 9), axis=0)
    inside = (centres @ equations[:, :3].T + equations[:, 3] <= 1e-9).all(axis=1)
    return np.asarray(cells[inside])


def _surface_cells(vertices: np.ndarray, faces: np.ndarray, cell: float) -> np.ndarray:
    """List cells along a surface, by points half a cell apart."""
    corners = vertices[faces]
    longest = np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2).max(axis=1)
    steps = np.clip(np.ceil(2 * longest / cell), 1, 64).astype(np.int64)
    parts = [np.zeros((0, 3), dtype=np.int64)]
    for step in np.unique(steps):
        i, j = np.meshgrid(np.arange(step + 1), np.arange(step + 1), indexing="ij")
        inside = i + j <= step
        weights = np.column_stack([i[inside], j[inside], step - i[inside] - j[inside]]) / step
        points = np.einsum("pk,fkd->fpd", weights, corners[steps == step]).reshape(-1, 3)
        parts.append(np.unique(np.floor(points / cell).astype(np.int64), axis=0))
    return np.unique(np.concatenate(parts), axis=0)
