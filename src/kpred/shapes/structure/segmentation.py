"""Parts of a mesh: what hangs together by shared vertices, small pieces joined to the part that they lie at."""

from __future__ import annotations

import numpy as np
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components

from kpred.ops.typing import Float, Int

MAX_PARTS = 32
"""Pieces beyond these, the smallest ones, are joined to others."""

MIN_SIDE = 0.04
"""A piece whose longest side is shorter than this fraction of the mesh's joins another: screws follow their board."""

_WELD = 1e-5
"""Vertices nearer than this fraction of the mesh's size are one, where triangles have none in common."""


def vertex_parts(
    vertices: Float[np.ndarray, "vertices 3"], faces: Int[np.ndarray, "faces 3"], max_parts: int = MAX_PARTS
) -> Int[np.ndarray, " vertices"]:
    """Find the part of each vertex, 0 to at most `max_parts` - 1.

    Parts are connected components, the largest first; small ones join the part whose box is nearest to their middle.
    A vertex that no face uses belongs to the part nearest to it.
    """
    component = _components(vertices, faces)
    count = int(component.max()) + 1
    low, high = np.full((count, 3), np.inf), np.full((count, 3), -np.inf)
    np.minimum.at(low, component, vertices)
    np.maximum.at(high, component, vertices)
    corners = vertices[faces].astype(np.float64)
    area = np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1)
    area_of = np.bincount(component[faces[:, 0]], area, count)
    order = np.argsort(-area_of, kind="stable")
    side = (high - low).max(axis=1)
    least = MIN_SIDE * float(np.ptp(vertices, axis=0).max())
    large = [c for c in order if side[c] >= least and area_of[c] > 0]
    anchors = np.array((large or list(order))[:max_parts])
    middle = (low + high) / 2
    # Distance from each piece's middle to each anchor's box; a piece inside several boxes joins the smallest of them.
    gap = np.maximum(0, np.maximum(low[anchors] - middle[:, None], middle[:, None] - high[anchors])).sum(axis=2)
    part_of = np.argmin(gap + 1e-6 * side[anchors], axis=1)
    part_of[anchors] = np.arange(len(anchors))
    found: np.ndarray = part_of[component].astype(np.int32)
    return found


def _components(vertices: np.ndarray, faces: np.ndarray) -> np.ndarray:
    """Return number the component of each vertex (V,); positions are welded where hardly any faces are connected."""
    found = _connected(faces, np.arange(len(vertices)))
    if found[faces[:, 0]].max(initial=0) + 1 > len(faces) / 2 and len(faces) > 2:
        size = float(np.ptp(vertices, axis=0).max()) or 1.0
        grid = np.round(vertices / (size * _WELD)).astype(np.int64)
        welded = np.unique(grid, axis=0, return_inverse=True)[1].reshape(-1)
        found = _connected(faces, welded)
    return found


def _connected(faces: np.ndarray, welded: np.ndarray) -> np.ndarray:
    corners, count = welded[faces], int(welded.max()) + 1
    rows, columns = corners[:, [0, 1]].reshape(-1), corners[:, [1, 2]].reshape(-1)
    graph = coo_matrix((np.ones(len(rows), np.int8), (rows, columns)), shape=(count, count))
    return connected_components(graph, directed=False)[1][welded]
