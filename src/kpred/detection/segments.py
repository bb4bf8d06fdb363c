"""Over-segmentation of a room's voxels into smooth pieces, each on one object (Felzenszwalb and Huttenlocher 2004)."""

from __future__ import annotations

from typing import no_type_check

import numba
import numpy as np
from scipy.spatial import cKDTree

from kpred.ops.typing import Float, Int
from kpred.ops.worksharing import thread_count

NEIGHBOURS = 8
REACH = 2.5
"""Voxels are neighbours up to this distance, in median spacings."""

SCALE = 0.35
"""Preference for large pieces: a piece of n voxels bears edges up to `SCALE / n` above its roughest own edge."""

MIN_VOXELS = 12
"""Smaller pieces join the neighbour across their smoothest edge."""

BENT = 0.3
"""Weight of edges across concave folds, where objects touch, is raised by this; convex folds are of one object."""


def neighbour_edges(
    points: Float[np.ndarray, "voxels 3"], reach: float | None = None, neighbours: int = NEIGHBOURS
) -> tuple[Int[np.ndarray, "edges 2"], Float[np.ndarray, " edges"]]:
    """List pairs of near voxels, each once, and their distances; `reach` is at most this far."""
    if len(points) < 2:
        return np.zeros((0, 2), np.int64), np.zeros(0)
    tree = cKDTree(points, balanced_tree=False)
    distance, index = tree.query(points, k=min(neighbours + 1, len(points)), workers=thread_count())
    limit = REACH * float(np.median(distance[:, 1:].mean(axis=1))) if reach is None else reach
    first = np.repeat(np.arange(len(points)), index.shape[1] - 1)
    second, far = index[:, 1:].ravel(), distance[:, 1:].ravel()
    near = far <= limit
    pairs = np.sort(np.column_stack([first[near], second[near]]), axis=1)
    _, once = np.unique(pairs[:, 0] * len(points) + pairs[:, 1], return_index=True)
    return pairs[once], far[near][once]


def segment_voxels(
    points: Float[np.ndarray, "voxels 3"],
    normals: Float[np.ndarray, "voxels 3"],
    edges: Int[np.ndarray, "edges 2"],
    scale: float = SCALE,
    min_voxels: int = MIN_VOXELS,
) -> Int[np.ndarray, " voxels"]:
    """Return the number of the smooth piece of each voxel, (V,), from 0."""
    if not len(edges):
        return np.arange(len(points))
    weights = edge_weights(points, normals, edges)
    order = np.argsort(weights, kind="stable")
    roots = _grow(len(points), edges[order], weights[order], scale, min_voxels)
    return np.unique(roots, return_inverse=True)[1]


def edge_weights(points: np.ndarray, normals: np.ndarray, edges: np.ndarray) -> Float[np.ndarray, " edges"]:
    """Measure roughness of each edge: 1 - |cosine| of the normals, and a little for steps out of the surface."""
    one, other = edges.T
    step = points[other] - points[one]
    length = np.maximum(np.linalg.norm(step, axis=1), 1e-9)
    bend = 1.0 - np.abs((normals[one] * normals[other]).sum(axis=1))
    rise = (np.abs((normals[one] * step).sum(axis=1)) + np.abs((normals[other] * step).sum(axis=1))) / (2 * length)
    return np.asarray(bend + BENT * rise**2)


@numba.njit(cache=True, nogil=True)
@no_type_check
def _grow(count, edges, weights, scale, min_size):
    """Join pieces across edges by rising weight while they are as smooth as the pieces; return roots (count,)."""
    parent = np.arange(count)
    size = np.ones(count, np.int64)
    bound = np.full(count, scale)
    for turn in range(2):
        for row in range(len(edges)):
            a, b = edges[row, 0], edges[row, 1]
            while parent[a] != a:
                parent[a] = parent[parent[a]]
                a = parent[a]
            while parent[b] != b:
                parent[b] = parent[parent[b]]
                b = parent[b]
            if a == b:
                continue
            joins = weights[row] <= bound[a] and weights[row] <= bound[b]
            if turn == 1:
                joins = size[a] < min_size or size[b] < min_size
            if joins:
                parent[b] = a
                size[a] += size[b]
                bound[a] = weights[row] + scale / size[a]
    for row in range(count):
        root = row
        while parent[root] != root:
            root = parent[root]
        parent[row] = root
    return parent
