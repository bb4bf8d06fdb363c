"""Parts of CAD models that are no part of the furniture: shadow planes under it, helpers far from it."""

from __future__ import annotations

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from kpred.shapes.mesh import Mesh

_FLAT = 0.01
"""Thickness over extent up to which a part is a plane."""

_BEYOND = 1.3
"""How many times as long as the rest a plane under it is, at least, along one side."""

_MAX_FACES = 200_000
"""Larger meshes are not looked at: they are scans or very detailed."""


def helper_part(mesh: Mesh) -> str | None:
    """Name what in a mesh, y up, seems to be no part of the furniture; None where nothing does.

    A plane at the bottom that is larger than all the rest (a shadow plane or a floor), or a part farther from the rest
    than the rest is large (a light, a camera, another thing).
    """
    if not 1 < len(mesh.faces) <= _MAX_FACES:
        return None
    labels = _parts_of_faces(mesh)
    count = int(labels.max()) + 1
    if count < 2:
        return None
    corners = mesh.vertices[mesh.faces].astype(np.float64)
    low, high = np.full((count, 3), np.inf), np.full((count, 3), -np.inf)
    np.minimum.at(low, labels, corners.min(axis=1))
    np.maximum.at(high, labels, corners.max(axis=1))
    for part in np.argsort(-(high - low).max(axis=1))[:8]:
        others = np.arange(count) != part
        rest_low, rest_high = low[others].min(axis=0), high[others].max(axis=0)
        size, rest = high[part] - low[part], rest_high - rest_low
        is_flat = size[1] <= _FLAT * max(size[0], size[2])
        is_under = low[part, 1] <= rest_low[1] + _FLAT * rest[1] + 1e-9
        if is_flat and is_under and (size[[0, 2]] > _BEYOND * rest[[0, 2]]).any():
            return "a flat part under it is larger than the rest (a shadow plane or a floor?)"
    return _far_part(low, high)


def _far_part(low: np.ndarray, high: np.ndarray) -> str | None:
    """Test whether one part lies farther from the box of all others than that box is large."""
    if len(low) > 2000:
        return None
    for part in range(len(low)):
        others = np.arange(len(low)) != part
        rest_low, rest_high = low[others].min(axis=0), high[others].max(axis=0)
        gap = np.maximum(rest_low - high[part], low[part] - rest_high).max()
        if gap > np.linalg.norm(rest_high - rest_low) and gap > 0:
            return "a part of it lies far from the rest (a light, a camera or another thing?)"
    return None


def _parts_of_faces(mesh: Mesh) -> np.ndarray:
    """Return number the connected part of each face (F,); vertices at the same position are welded."""
    _, vertex = np.unique(mesh.vertices, axis=0, return_inverse=True)
    faces = vertex.reshape(-1)[mesh.faces]
    count = int(faces.max()) + 1
    edges = np.concatenate([faces[:, [0, 1]], faces[:, [1, 2]]])
    graph = coo_array((np.ones(len(edges)), (edges[:, 0], edges[:, 1])), shape=(count, count))
    _, component = connected_components(graph, directed=False)
    _, labels = np.unique(component[faces[:, 0]], return_inverse=True)
    return np.asarray(labels).reshape(-1)
