"""Thin flat sheets at one end of a cloud: where they lie, how wide they are, which of their points are the object's."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.ndimage import uniform_filter
from scipy.spatial import ConvexHull, QhullError, cKDTree

from kpred.ops.typing import Bool, Float
from kpred.preprocessing.outliers import outside_hull, plane_axes

STEEPEST = 0.07
"""A sheet may lean by this slope (four degrees) against the direction it was looked for in."""

NARROW = 0.11
"""Strips up to this share of the size across are not wide: the arms of a swivel chair's star are."""


@dataclass(frozen=True)
class Sheet:
    """A thin flat layer of points at one end of a cloud.

    Attributes:
        normal: unit vector from the sheet to where the object is.
        height: (N,) of every point above the sheet's middle plane, along the normal.
        plane: (N, 2) coordinates of every point in the sheet's plane.
        thickness: half of the layer's, three standard deviations of its noise.
        cell: edge of the squares in which its area is counted.
        wide: (N,) points of the layer with the layer on all sides around them: no feet, bars or edges.
    """

    normal: Float[np.ndarray, "3"]
    height: Float[np.ndarray, " points"]
    plane: Float[np.ndarray, "points 2"]
    thickness: float
    cell: float
    wide: Bool[np.ndarray, " points"]

    @property
    def inside(self) -> Bool[np.ndarray, " points"]:
        """(N,) points of the layer."""
        return np.abs(self.height) <= self.thickness

    def area(self, mask: np.ndarray) -> float:
        """Area that these points cover, in whole cells."""
        if not mask.any():
            return 0.0
        return len(np.unique(_cells(self.plane[mask], self.cell))) * self.cell**2


def end_sheet(
    points: Float[np.ndarray, "points 3"],
    reach: Float[np.ndarray, " points"],
    inward: Float[np.ndarray, "3"],
    size: float,
    depth: float = 0.08,
    among: Bool[np.ndarray, " points"] | None = None,
) -> Sheet | None:
    """The sheet at the end of a cloud that `inward` (a unit vector) leads away from; None if there is none.

    The plane is fitted, so `inward` may be wrong by four degrees.

    Args:
        reach: each point's distance to its neighbours, see `Neighbourhood`.
        size: of the scan, in its units.
        depth: share of the size, from the end, in which the sheet is looked for.
        among: points that the sheet is looked for among; default all.
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
    if np.hypot(*slope) > STEEPEST or member.sum() < 12:
        return None
    normal = inward - slope @ plane_axes(inward)
    length = float(np.linalg.norm(normal))
    # Half of the cells would be empty at random if they were as small as the spacing.
    cell = max(1.2 * float(np.median(reach[member])), 0.015 * size)
    if cell > 0.06 * size:
        return None
    wide = _wide(plane, member, cell, int(max(2, round((NARROW * size / cell - 1) / 2))))
    if not wide.any():
        return None
    return Sheet(normal / length, above / length, plane, thickness, cell, wide)


def own_points(
    sheet: Sheet, rest: Bool[np.ndarray, " points"], size: float, walled: float
) -> Bool[np.ndarray, " points"]:
    """Points of the sheet that are the object's own: under its feet and walls, or its bottom board.

    A point is under something if there is something of the object close above it. The bottom board (or back board) of
    a closed body is what lies inside of the outline of its walls, if walls stand along enough of that outline.

    Args:
        rest: (N,) points of the object.
        walled: which share of the outline is enough.
    """
    inside = sheet.inside
    # Not from the layer's very rim: its own noise would then stand everywhere on it.
    foot = 1.6 * sheet.thickness
    above = rest & (sheet.height > foot) & (sheet.height <= foot + 0.03 * size)
    result = np.zeros(len(inside), dtype=bool)
    if above.sum() < 3:
        return result
    queries = sheet.plane[inside]
    under = cKDTree(sheet.plane[above]).query(queries, distance_upper_bound=0.012 * size)[0] < np.inf
    walls = sheet.plane[above & (sheet.height <= foot + 0.02 * size)]
    if len(walls) >= 12 and walled_share(walls, 0.03 * size) >= walled:
        under |= outside_hull(queries, walls) < 0.0
    result[inside] = under
    return result


def walled_share(stand: Float[np.ndarray, "points 2"], near: float) -> float:
    """Share of the outline (convex hull) of 2-D points that has one of them nearby."""
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
    """Members in or beside cells that have members in most cells around, up to `around` cells away."""
    index = np.floor((plane[member] - plane[member].min(axis=0)) / cell).astype(np.int64) + 1
    grid = np.zeros(index.max(axis=0) + 2, dtype=np.float32)
    grid[index[:, 0], index[:, 1]] = 1.0
    core = uniform_filter(grid, 2 * around + 1, mode="constant") > 0.7
    grown = uniform_filter(core.astype(np.float32), 2 * around - 1, mode="constant") > 1e-4
    result = np.zeros(len(plane), dtype=bool)
    result[np.flatnonzero(member)[grown[index[:, 0], index[:, 1]]]] = True
    return result
