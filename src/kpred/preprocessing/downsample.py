"""Downsampling of a cloud to the same number of points per area on every surface."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from scipy.spatial import cKDTree

from kpred.ops.typing import Float, Int


class VoxelGrid(NamedTuple):
    """Cells of a cloud.

    Attributes:
        rows: (C,) index of the point nearest to the middle of each cell's points.
        cell: (N,) cell of each point; edge: of a cell.
    """

    rows: Int[np.ndarray, " cells"]
    cell: Int[np.ndarray, " points"]
    edge: float


def voxel_representatives(points: Float[np.ndarray, "points 3"], count: int) -> VoxelGrid:
    """Select one point for each occupied cell of a grid with about `count` occupied cells."""
    low = points.min(axis=0)
    edge = float((points.max(axis=0) - low).max()) / np.sqrt(max(count, 4) / 4.0)
    cell = np.zeros(len(points), dtype=np.int64)
    cells = 1
    for _ in range(4):
        grid = ((points - low) / max(edge, np.finfo(float).tiny)).astype(np.int64)
        span = grid.max(axis=0) + 1
        key = (grid[:, 0] * span[1] + grid[:, 1]) * span[2] + grid[:, 2]
        _, cell = np.unique(key, return_inverse=True)
        cells = int(cell.max()) + 1
        if 0.75 * count <= cells <= 1.25 * count:
            break
        edge *= float(np.clip(np.sqrt(cells / count), 0.2, 5.0))
    members = np.bincount(cell)
    middle = np.stack([np.bincount(cell, points[:, axis]) for axis in range(3)], axis=1) / members[:, None]
    off = ((points - middle[cell]) ** 2).sum(axis=1)
    # By cell, then by distance to its middle, in one sort: distances within a cell are below three squared edges.
    order = np.argsort(cell + np.minimum(off / (4.0 * max(edge, np.finfo(float).tiny) ** 2), 0.999), kind="stable")
    first = np.cumsum(members) - members
    return VoxelGrid(order[first], cell, edge)


def poisson_disc(
    points: Float[np.ndarray, "points 3"], min_count: int, seed: int
) -> tuple[Int[np.ndarray, " kept"], float]:
    """Select a Poisson-disc subset of at least `min_count` points, with the largest possible distance.

    Unlike a grid, it treats surfaces of all directions alike. Sparser surfaces stay as they are.

    Returns:
        Indices in ascending order, and the distance; all of them and 0 if there are no more than `min_count`.
    """
    count = len(points)
    everything = np.arange(count)
    if count <= min_count:
        return everything, 0.0
    tree = cKDTree(points, balanced_tree=False, compact_nodes=False)
    priority = np.random.default_rng(seed).permutation(count)
    # Discs that hold m others on average leave about one point in 1 + m / 2 (measured, on even surfaces).
    sample = priority[: min(count, 512)]
    neighbour = min(9, count)
    spacing = float(np.median(tree.query(points[sample], k=neighbour)[0][:, -1]))
    others = 2.0 * (count / min(1.07 * min_count, 0.999 * count) - 1.0)
    radius = spacing * np.sqrt(others / (neighbour - 1))
    if radius == 0.0:
        return everything, 0.0
    candidates = everything
    if np.mean(tree.query_ball_point(points[sample], radius, return_length=True)) > 40:
        # Clumps would need memory for all of their pairs; a grid finer than the distance reduces them first.
        grid = np.floor((points - points.min(axis=0)) / (radius / 3)).astype(np.int64)
        candidates = np.sort(priority[np.unique(grid[priority], axis=0, return_index=True)[1]])
        points, priority = points[candidates], np.argsort(np.argsort(priority[candidates]))
        tree = cKDTree(points, balanced_tree=False, compact_nodes=False)
    for _ in range(6):
        kept = _greedy(tree, points, priority, radius)
        if len(kept) >= min_count:
            return candidates[kept], radius
        radius *= 0.95 * np.sqrt(len(kept) / min_count)
    return everything, 0.0


def _greedy(tree: cKDTree, points: np.ndarray, priority: np.ndarray, radius: float) -> np.ndarray:
    """Select, in the order of `priority`, each point farther than `radius` from all selected before."""
    count = len(points)
    pairs = tree.query_pairs(radius, output_type="ndarray")
    first = np.concatenate([pairs[:, 0], pairs[:, 1]])
    second = np.concatenate([pairs[:, 1], pairs[:, 0]])
    order = np.argsort(first, kind="stable")
    neighbours = second[order]
    ends = np.cumsum(np.bincount(first, minlength=count)).tolist()
    alive = np.ones(count, dtype=bool)
    kept = []
    for point in priority.tolist():
        if alive[point]:
            kept.append(point)
            alive[neighbours[ends[point - 1] if point else 0 : ends[point]]] = False
    return np.sort(np.array(kept, dtype=np.int64))
