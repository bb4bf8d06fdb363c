"""Parts of a mesh: by its own labels and by what hangs together; needs nothing but numpy."""

from __future__ import annotations

import numpy as np

from kpred.ops.typing import Int
from kpred.shapes.mesh import Mesh

_WELD = 1e-5
"""Corners nearer than this fraction of the mesh's size are one, where triangles share no vertices."""


def part_labels(mesh: Mesh, max_parts: int) -> Int[np.ndarray, " faces"]:
    """Return label the part of each face, 0 to at most `max_parts` - 1; deterministic.

    A part is what hangs together by shared vertices (a box of a cuboid assembly) and carries one label where the faces
    are labelled (`Mesh.face_parts`, as the generator's). Of more than `max_parts` parts the smallest are joined one by
    one to the nearest, to one with the same label if there is any.
    """
    if max_parts < 1:
        raise ValueError(f"A mesh has at least one part, but at most {max_parts} are wanted.")
    component = _components(mesh.faces, len(mesh.vertices))
    if component.max(initial=0) + 1 > len(mesh.faces) / 2 and len(mesh.faces) > 2:
        component = _components(_welded(mesh), len(mesh.vertices))
    given = np.zeros(len(mesh.faces), np.int64) if mesh.face_parts is None else mesh.face_parts.astype(np.int64)
    groups, label = np.unique(np.stack([component, given], axis=1), axis=0, return_inverse=True)
    label = label.reshape(-1)
    if len(groups) > max_parts:
        label = _joined(mesh, label, groups[:, 1], max_parts)
    found: np.ndarray = np.unique(label, return_inverse=True)[1].reshape(-1)
    return found


def _components(faces: np.ndarray, vertices: int) -> np.ndarray:
    """Return number the connected component of each face (F,), by lowest vertex."""
    label = np.arange(vertices)
    while True:
        lowest = label[faces].min(axis=1, initial=vertices)
        before = label.copy()
        np.minimum.at(label, faces.reshape(-1), np.repeat(lowest, 3))
        label = label[label]
        if (label == before).all():
            break
    return np.unique(label[faces[:, 0]], return_inverse=True)[1].reshape(-1)


def _welded(mesh: Mesh) -> np.ndarray:
    """Return the faces with vertices of equal position welded."""
    size = float(np.ptp(mesh.vertices, axis=0).max()) or 1.0
    grid = np.round(mesh.vertices / (size * _WELD)).astype(np.int64)
    one: np.ndarray = np.unique(grid, axis=0, return_inverse=True)[1].reshape(-1)
    welded: np.ndarray = one[mesh.faces]
    return welded


def _joined(mesh: Mesh, label: np.ndarray, given: np.ndarray, max_parts: int) -> np.ndarray:
    """Join labels to at most `max_parts` groups; `given` is each group's own label."""
    count = len(given)
    area = np.bincount(label, mesh.face_areas(), count)
    corners = mesh.vertices[mesh.faces]
    low, high = np.full((count, 3), np.inf), np.full((count, 3), -np.inf)
    np.minimum.at(low, label, corners.min(axis=1))
    np.maximum.at(high, label, corners.max(axis=1))
    target, alive = np.arange(count), np.ones(count, bool)
    for _ in range(count - max_parts):
        small = int(np.where(alive, area, np.inf).argmin())
        alive[small] = False
        others = np.flatnonzero(alive & (given == given[small]))
        others = others if len(others) else np.flatnonzero(alive)
        gap = np.maximum(0, np.maximum(low[others] - high[small], low[small] - high[others]))
        middle = np.abs(low[others] + high[others] - low[small] - high[small])
        # Boxes that overlap are equally near: of these, the one with the nearest middle.
        near = int(others[np.lexsort((middle.sum(axis=1), gap.sum(axis=1)))[0]])
        target[small] = near
        area[near] += area[small]
        low[near], high[near] = np.minimum(low[near], low[small]), np.maximum(high[near], high[small])
    while (target[target] != target).any():
        target = target[target]
    joined: np.ndarray = target[label]
    return joined
