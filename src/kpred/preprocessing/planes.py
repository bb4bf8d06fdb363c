"""Planar patches at one end of a cloud: plane, width, and the points that belong to the object."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.ndimage import uniform_filter
from scipy.spatial import ConvexHull, QhullError, cKDTree

from kpred.ops.typing import Bool, Float
from kpred.preprocessing.outliers import outside_hull, plane_axes

MAX_SLOPE = 0.07
"""Maximum slope of a patch against the searched direction: four degrees."""

MIN_WIDTH = 0.11
"""Minimum width of a wide patch, as a fraction of the size: above the arms of a swivel chair's star."""


@dataclass(frozen=True)
class PlanarPatch:
    """A thin planar layer of points at one end of a cloud.

    Attributes:
        normal: unit vector from the patch towards the object.
        height: (N,) of every point above the patch's middle plane, along the normal.
        plane: (N, 2) coordinates of every point in the patch's plane.
        thickness: half of the layer's, three standard deviations of its noise.
        cell: edge of the squares in which its area is counted.
        wide: (N,) mask of points with the layer on all sides around them: no feet, bars or edges.
    """

    normal: Float[np.ndarray, "3"]
    height: Float[np.ndarray, " points"]
    plane: Float[np.ndarray, "points 2"]
    thickness: float
    cell: float
    wide: Bool[np.ndarray, " points"]

    @property
    def inside(self) -> Bool[np.ndarray, " points"]:
        """Mask (N,) of the layer's points."""
        return np.abs(self.height) <= self.thickness

    def area(self, mask: np.ndarray) -> float:
        """Measure the area that the masked points cover, in whole cells."""
        if not mask.any():
            return 0.0
        return len(np.unique(_cells(self.plane[mask], self.cell))) * self.cell**2


def find_end_patch(
    points: Float[np.ndarray, "points 3"],
    reach: Float[np.ndarray, " points"],
    inward: Float[np.ndarray, "3"],
    size: float,
    depth: float = 0.08,
    among: Bool[np.ndarray, " points"] | None = None,
) -> PlanarPatch | None:
    """Find the planar patch at the end of a cloud opposite to `inward` (a unit vector), or None.

    The plane is fitted, so `inward` may be wrong by four degrees.

    Args:
        reach: each point's distance to its neighbours, see `Neighbourhood`.
        size: of the scan, in its units.
        depth: fraction of the size, from the end, that is searched.
        among: mask of the points that are searched; default all.
    """
    among = np.ones(len(points), dtype=bool) if among is None else among
    if among.sum() < 12:
        return None
    height = points @ inward
    low = float(np.quantile(height[among], 0.002))
    step = 0.008 * size
    level = np.floor((height - low) / step).astype(np.int64)
    near_end = among & (level >= -1) & (level <= depth / 0.008)
    counts = np.bincount(level[near_end] + 1)
    if len(counts) < 2:
        return None
    pairs = counts[1:] + counts[:-1]
    peak = int(pairs.argmax())
    if pairs[peak] < max(12, 0.02 * len(points)):
        return None
    plane = points @ plane_axes(inward).T
    center = plane[near_end].mean(axis=0)
    design = np.column_stack([np.ones(len(points)), (plane - center) / size])
    above = height - (low + peak * step)
    member = among & (np.abs(above) <= 1.5 * step)
    coefficients = np.zeros(3)
    for _ in range(4):
        if member.sum() < 12:
            return None
        coefficients = np.linalg.lstsq(design[member], height[member], rcond=None)[0]
        above = height - design @ coefficients
        noise = 1.4826 * float(np.median(np.abs(above[member])))
        thickness = float(np.clip(3.0 * noise, 0.005 * size, 0.02 * size))
        member = among & (np.abs(above) <= thickness)
    slope = coefficients[1:] / size
    if np.hypot(*slope) > MAX_SLOPE or member.sum() < 12:
        return None
    normal = inward - slope @ plane_axes(inward)
    length = float(np.linalg.norm(normal))
    # Half of the cells would be empty at random if they were as small as the spacing.
    cell = max(1.2 * float(np.median(reach[member])), 0.015 * size)
    if cell > 0.06 * size:
        return None
    wide = _wide(plane, member, cell, int(max(2, round((MIN_WIDTH * size / cell - 1) / 2))))
    if not wide.any():
        return None
    return PlanarPatch(normal / length, above / length, plane, thickness, cell, wide)


def object_points(
    patch: PlanarPatch, rest: Bool[np.ndarray, " points"], size: float, min_coverage: float
) -> Bool[np.ndarray, " points"]:
    """Return a mask (N,) of the patch's points that belong to the object: below feet and walls, or a board.

    A point belongs to it if a point of the object lies close above. The bottom board (or back board) of a closed body
    lies inside of the outline of its walls, if walls stand along enough of that outline.

    Args:
        rest: (N,) mask of the object's points.
        min_coverage: minimum fraction of the outline with walls.
    """
    inside = patch.inside
    # Starts above the layer's surface: its own noise would otherwise count as walls.
    foot = 1.6 * patch.thickness
    above = rest & (patch.height > foot) & (patch.height <= foot + 0.03 * size)
    result = np.zeros(len(inside), dtype=bool)
    if above.sum() < 3:
        return result
    queries = patch.plane[inside]
    under = cKDTree(patch.plane[above]).query(queries, distance_upper_bound=0.012 * size)[0] < np.inf
    walls = patch.plane[above & (patch.height <= foot + 0.02 * size)]
    if len(walls) >= 12 and outline_coverage(walls, 0.03 * size) >= min_coverage:
        under |= outside_hull(queries, walls) < 0.0
    result[inside] = under
    return result


def outline_coverage(stand: Float[np.ndarray, "points 2"], near: float) -> float:
    """Measure the fraction of the outline (convex hull) of points (N, 2) with a point nearby."""
    try:
        corners = stand[ConvexHull(stand).vertices]
    except (QhullError, ValueError):
        return 0.0
    edge = np.roll(corners, -1, axis=0) - corners
    length = np.hypot(*edge.T)
    position = (np.arange(128) + 0.5) / 128 * length.sum()
    start = np.cumsum(length) - length
    which = np.searchsorted(start, position, side="right") - 1
    along = (position - start[which]) / np.maximum(length[which], np.finfo(float).tiny)
    outline = corners[which] + along[:, None] * edge[which]
    distance, _ = cKDTree(stand).query(outline, distance_upper_bound=near)
    return float(np.isfinite(distance).mean())


def _cells(plane: np.ndarray, cell: float) -> np.ndarray:
    index = np.floor((plane - plane.min(axis=0)) / cell).astype(np.int64)
    numbered: np.ndarray = index[:, 0] * (int(index[:, 1].max()) + 1) + index[:, 1]
    return numbered


def _wide(plane: np.ndarray, member: np.ndarray, cell: float, around: int) -> Bool[np.ndarray, " points"]:
    """Return members in or beside cells with members in most cells around, up to `around` cells away."""
    index = np.floor((plane[member] - plane[member].min(axis=0)) / cell).astype(np.int64) + 1
    grid = np.zeros(index.max(axis=0) + 2, dtype=np.float32)
    grid[index[:, 0], index[:, 1]] = 1.0
    core = uniform_filter(grid, 2 * around + 1, mode="constant") > 0.7
    grown = uniform_filter(core.astype(np.float32), 2 * around - 1, mode="constant") > 1e-4
    result = np.zeros(len(plane), dtype=bool)
    result[np.flatnonzero(member)[grown[index[:, 0], index[:, 1]]]] = True
    return result
