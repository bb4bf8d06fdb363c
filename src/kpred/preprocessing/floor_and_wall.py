"""Detection of floor and wall in the scan of one object: pieces below it and behind it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from kpred.ops.typing import Bool, Float
from kpred.preprocessing.normals import neighbour_normals
from kpred.preprocessing.outliers import Neighbourhood, outside_hull
from kpred.preprocessing.planes import PlanarPatch, find_end_patch, object_points

MIN_FLOOR_COVERAGE = 0.45
"""Fraction of its outline along which a body must touch the floor to keep its bottom board: two of four sides."""

MIN_WALL_COVERAGE = 0.7
"""The same at a wall, higher: a table touches it along three of four sides and has no back board."""

MAX_PLATE_RADIUS, MAX_ARM_RADIUS = 0.33, 0.5
"""Maximum radius of the foot around a single column, as fractions of the scan's size."""

MAX_STAR_COVERAGE = 0.42
"""Maximum fraction of the disc around a star foot that its arms cover."""


@dataclass(frozen=True)
class RoomSurface:
    """A piece of floor or wall in a scan.

    Attributes:
        points: (N,) mask of the points to remove.
        patch: its planar patch.
        beyond: how far it reaches beyond the object, as area over the object's outline (floor) or as a fraction of the
            scan's size (wall).
    """

    points: Bool[np.ndarray, " points"]
    patch: PlanarPatch
    beyond: float


def detect_floor(
    points: Float[np.ndarray, "points 3"],
    reach: Float[np.ndarray, " points"],
    up: Float[np.ndarray, "3"],
    size: float,
    min_beyond: float,
    excluded: Bool[np.ndarray, " points"] | None = None,
    patch: PlanarPatch | None = None,
) -> RoomSurface | None:
    """Find a planar patch at the bottom that reaches beyond the object's footprint, or None.

    A patch within the footprint belongs to the object (plinth, bottom board, plate), and so does anything narrow
    (feet, sled bars, arms of a star) or close around a single column.

    Args:
        reach: each point's distance to its neighbours, see `Neighbourhood`.
        up: unit vector.
        size: of the scan, in its units.
        min_beyond: minimum area outside of the footprint, as a fraction of the footprint's.
        excluded: points known not to be the object's, such as the wall.
    """
    patch = patch or find_end_patch(points, reach, up, size)
    if patch is None:
        return None
    rest = patch.height > 1.5 * patch.thickness
    if excluded is not None:
        rest &= ~excluded
    # With almost nothing above it the patch is the object.
    if rest.sum() < max(24, 0.1 * len(points)):
        return None
    outside = outside_hull(patch.plane, _trimmed(patch.plane[rest]))
    out = patch.wide & (outside > 0.02 * size)
    footprint = patch.area(rest)
    beyond = patch.area(out) / max(footprint, patch.cell**2)
    if beyond < min_beyond or out.sum() < 0.08 * patch.wide.sum():
        return None
    if is_foot(patch, rest, size):
        return None
    own = object_points(patch, rest, size, MIN_FLOOR_COVERAGE)
    removed = (patch.inside | (patch.height < -patch.thickness)) & ~own
    return RoomSurface(removed, patch, beyond)


def detect_wall(
    points: Float[np.ndarray, "points 3"],
    reach: Float[np.ndarray, " points"],
    up: Float[np.ndarray, "3"],
    size: float,
    min_beyond: float,
    directions: list[np.ndarray],
    standing: Bool[np.ndarray, " points"],
) -> RoomSurface | None:
    """Find a vertical planar patch at one side that reaches beyond the object, or None.

    It must reach beyond the object on both sides, or on one side and above: a chair's back reaches above the rest of
    the chair only, and of two sides of a cabinet seen over their corner each reaches beyond the other on one side.

    Args:
        directions: unit vectors from possible walls to the object, see `wall_directions`.
        min_beyond: minimum reach on the second farthest side, as a fraction of the size; others as for `detect_floor`.
        standing: mask of points outside of a patch at the bottom: a floor may reach behind the wall.
    """
    best: RoomSurface | None = None
    for inward in directions:
        patch = find_end_patch(points, reach, inward, size, among=standing)
        if patch is None:
            continue
        rest = standing & (patch.height > 1.5 * patch.thickness)
        if rest.sum() < max(24, 0.1 * len(points)):
            continue
        # An object is not thin: points within a few centimetres of the patch are its frame or mouldings.
        if np.quantile(patch.height[rest], 0.9) < 0.1 * size:
            continue
        beyond = _reach_beyond(points, patch, rest, up, size)
        if beyond < min_beyond or (best is not None and beyond <= best.beyond):
            continue
        removed = (patch.inside | (patch.height < -patch.thickness)) & ~object_points(
            patch, rest, size, MIN_WALL_COVERAGE
        )
        if removed.sum() <= 0.75 * len(points):
            best = RoomSurface(removed, patch, beyond)
    return best


def _reach_beyond(points: np.ndarray, patch: PlanarPatch, rest: np.ndarray, up: np.ndarray, size: float) -> float:
    """Return the second largest reach beyond the rest: left, right, above; fraction of the size."""
    lateral = points @ np.cross(up, patch.normal)
    level = points @ up
    low, high = np.quantile(lateral[rest], [0.005, 0.995])
    top = float(np.quantile(level[rest], 0.995))
    wide_lateral, wide_level = lateral[patch.wide], level[patch.wide]
    # The outermost few points are noise.
    left = low - float(np.quantile(wide_lateral, 0.03))
    right = float(np.quantile(wide_lateral, 0.97)) - high
    above = float(np.quantile(wide_level, 0.97)) - top
    second = float(np.sort([left, right, above])[1])
    return second / size if max(left, right) > 0 else 0.0


def wall_directions(
    points: Float[np.ndarray, "points 3"], near: Neighbourhood, up: Float[np.ndarray, "3"]
) -> list[np.ndarray]:
    """Return horizontal unit vectors (3,), away from the planes with many points of vertical surfaces."""
    rows = np.arange(0, len(points), max(1, len(points) // 1200))
    normals, planarity = neighbour_normals(points, np.column_stack([rows, near.index[rows]]))
    vertical = (np.abs(normals @ up) < 0.2) & (planarity > 0.3)
    if vertical.sum() < 0.03 * len(rows):
        return []
    east = np.cross(up, np.eye(3)[np.abs(up).argmin()])
    east /= np.linalg.norm(east)
    north = np.cross(up, east)
    angle = np.arctan2(normals[vertical] @ north, normals[vertical] @ east) % np.pi
    bins = 60
    counts = np.bincount((angle / np.pi * bins).astype(np.int64) % bins, minlength=bins).astype(float)
    smooth = counts + np.roll(counts, 1) + np.roll(counts, -1)
    directions: list[np.ndarray] = []
    for _ in range(3):
        peak = int(smooth.argmax())
        if smooth[peak] < 0.02 * len(rows):
            break
        middle = (peak + 0.5) * np.pi / bins
        offset = (angle - middle + np.pi / 2) % np.pi - np.pi / 2
        exact = middle + float(np.median(offset[np.abs(offset) <= 1.5 * np.pi / bins]))
        direction = np.cos(exact) * east + np.sin(exact) * north
        directions += [direction, -direction]
        smooth[(peak + np.arange(-3, 4)) % bins] = 0.0
    return directions


def is_foot(patch: PlanarPatch, rest: np.ndarray, size: float) -> bool:
    """Test whether the patch is the plate, ring or star under a single column, as of a swivel chair."""
    above = rest & (patch.height > 0.09 * size) & (patch.height <= 0.2 * size)
    if above.sum() < 3:
        return False
    center = np.median(patch.plane[above], axis=0)
    column = np.linalg.norm(patch.plane[above] - center, axis=1)
    foot = np.linalg.norm(patch.plane[patch.inside] - center, axis=1)
    longest = float(np.quantile(foot, 0.97))
    if np.quantile(column, 0.9) > 0.08 * size or longest > MAX_ARM_RADIUS * size:
        return False
    return longest < MAX_PLATE_RADIUS * size or patch.area(patch.inside) < MAX_STAR_COVERAGE * np.pi * longest**2


def _trimmed(plane: np.ndarray) -> np.ndarray:
    """Drop the outermost half percent: one outlier must not widen the outline."""
    if len(plane) < 400:
        return plane
    distance = np.linalg.norm(plane - plane.mean(axis=0), axis=1)
    kept: np.ndarray = plane[distance <= np.quantile(distance, 0.995)]
    return kept
