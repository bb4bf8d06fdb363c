"""A room on a voxel grid: one point a cell, so that time and memory do not follow the number of scanned points."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.spatial import cKDTree

from kpred.ops.typing import Float, Int
from kpred.ops.worksharing import thread_count

CELL = 0.02
"""Metres: edge of a cell, unless the room needs more than `MAX_VOXELS` of them."""

MAX_VOXELS = 120_000
"""Rooms of more surface than this are put on a coarser grid."""

STRAY_REACH, STRAY_NEIGHBOURS = 0.12, 3
"""Metres within which a voxel of a surface has so many others; six cells where these are more."""

_COARSER = 1.25
_MAX_CELLS_A_SIDE = 1 << 20


@dataclass(frozen=True, eq=False)
class VoxelGrid:
    """The occupied cells of a cloud.

    Attributes:
        points: (V, 3) mean of the points in each cell, in the cloud's frame and unit.
        counts: (V,) points in each cell.
        cell: edge of a cell, in the cloud's unit.
        owner: (N,) cell of each point of the cloud; -1 for points that are not finite.
    """

    points: Float[np.ndarray, "voxels 3"]
    counts: Int[np.ndarray, " voxels"]
    cell: float
    owner: Int[np.ndarray, " points"]

    def __len__(self) -> int:
        return len(self.points)


def voxel_grid(points: Float[np.ndarray, "points 3"], cell: float = CELL, max_voxels: int = MAX_VOXELS) -> VoxelGrid:
    """Put a cloud on a grid of cubes, coarser than `cell` if more than `max_voxels` would be occupied."""
    finite = np.isfinite(points).all(axis=1)
    rows = np.flatnonzero(finite)
    solid = np.asarray(points[rows], dtype=np.float64)
    if not len(rows):
        return VoxelGrid(np.zeros((0, 3)), np.zeros(0, np.int64), cell, np.full(len(points), -1, np.int64))
    low = solid.min(axis=0)
    edge = max(cell, float((solid.max(axis=0) - low).max()) / _MAX_CELLS_A_SIDE)
    _, owner = np.unique(_codes(solid, low, edge), return_inverse=True)
    while (count := int(owner.max()) + 1) > max_voxels:
        # Surfaces: the number of cells falls with the square of their edge.
        edge *= max(_COARSER, 0.95 * float(np.sqrt(count / max_voxels)))
        _, owner = np.unique(_codes(solid, low, edge), return_inverse=True)
    counts = np.bincount(owner, minlength=count)
    sums = np.stack([np.bincount(owner, solid[:, axis], minlength=count) for axis in range(3)], axis=1)
    every = np.full(len(points), -1, dtype=np.int64)
    every[rows] = owner
    return VoxelGrid(sums / counts[:, None], counts, edge, every)


def without_strays(grid: VoxelGrid, reach: float) -> VoxelGrid:
    """Return a grid without voxels that stand alone; their points have no cell. All stay if most would go.

    Args:
        reach: distance within which a voxel of a surface has `STRAY_NEIGHBOURS` others.
    """
    if len(grid) <= STRAY_NEIGHBOURS:
        return grid
    tree = cKDTree(grid.points, balanced_tree=False)
    distance, _ = tree.query(grid.points, k=STRAY_NEIGHBOURS + 1, distance_upper_bound=reach, workers=thread_count())
    kept = np.isfinite(distance[:, -1])
    if kept.all() or kept.mean() < 0.5:
        return grid
    number = np.append(np.where(kept, np.cumsum(kept) - 1, -1), -1)
    return VoxelGrid(grid.points[kept], grid.counts[kept], grid.cell, number[grid.owner])


def _codes(points: np.ndarray, low: np.ndarray, edge: float) -> np.ndarray:
    index = np.floor((points - low) / edge).astype(np.int64)
    size = index.max(axis=0) + 1
    codes: np.ndarray = (index[:, 0] * size[1] + index[:, 1]) * size[2] + index[:, 2]
    return codes
