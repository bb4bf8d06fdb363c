"""Floor, walls and ceiling of an upright room: which voxels are the room itself and none of its objects."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from kpred.ops.typing import Bool, Float
from kpred.preprocessing.normals import estimate_normals

FLOOR_TOLERANCE = 0.04
"""Metres about the floor's plane that are floor: scans are noisy and bend, and feet lose little by it."""

MAX_FLOOR_SLOPE = 0.05
COLUMN = 0.25
"""Metres: width of the upright columns whose lowest points show the floor."""

MIN_FLOOR_COLUMNS = 0.12
"""Fraction of a room's columns in which a floor must be the lowest layer."""

MIN_FLOOR_INSIDE = 0.1
"""Fraction of a floor's columns with floor on all four sides."""

MIN_CEILING_HEIGHT = 1.9
MIN_CEILING_AREA = 0.12
"""Metres above the floor, and fraction of the room's columns, of a ceiling."""

LEVEL, UPRIGHT = 0.9, 0.25
"""Least and most vertical component of the normals of level and of upright surfaces."""

WALL_TOLERANCE = 0.05
MIN_WALL_WIDTH, MIN_WALL_TOP = 0.9, 1.7
"""Metres: a wall is at least so wide, and reaches so high."""

MIN_WALL_AREA = 1.2
"""Square metres of a wall that must be seen."""

MAX_OUTSIDE = 0.04
"""Fraction of the room's voxels that may lie beyond an outer wall."""

END, LOW_WALL = 0.02, (0.6, 0.35)
"""A lower layer is a wall if no more than the first fraction of the room is beyond it, and if it has these fractions of
the room's height and of its length.
"""

INNER_TOP, MAX_BEHIND = 0.85, 0.1
"""Of a wall with the room beside it: its top as a fraction of the room's height; voxels behind it to those on it."""

_ANGLES = 90
_CELL = 0.1


@dataclass(frozen=True, eq=False)
class Structure:
    """The room itself.

    Attributes:
        plane: (3,) slopes along x and y and level: height of the floor = slope @ (x, y) + level.
        found: whether there is a floor; without one, `plane` is the level of the lowest points.
        height: (V,) of every voxel above that plane, metres.
        mask: (V,) True for voxels of floor, walls and ceiling and beyond them.
        normals: (V, 3) unit normals; planarity: (V,) in [0, 1].
    """

    plane: Float[np.ndarray, "3"]
    found: bool
    height: Float[np.ndarray, " voxels"]
    mask: Bool[np.ndarray, " voxels"]
    normals: Float[np.ndarray, "voxels 3"]
    planarity: Float[np.ndarray, " voxels"]


def find_structure(points: Float[np.ndarray, "voxels 3"]) -> Structure:
    """Find floor, walls and ceiling of a room of voxels in metres, z up."""
    normals, planarity = estimate_normals(points, neighbours=16)
    plane, found = _floor(points)
    height = points[:, 2] - points[:, :2] @ plane[:2] - plane[2]
    mask = height < (FLOOR_TOLERANCE if found else 0.0)
    mask |= _ceiling(points, height, normals)
    for wall in _walls(points, height, normals, mask, planarity):
        mask |= wall
    return Structure(plane, found, height, mask, normals, planarity)


def _floor(points: np.ndarray) -> tuple[np.ndarray, bool]:
    """Fit the lowest nearly level plane: slopes and level (3,), and whether it is a floor."""
    column = np.floor((points[:, :2] - points[:, :2].min(axis=0)) / COLUMN).astype(np.int64)
    order = np.argsort(points[:, 2], kind="stable")
    _, first = np.unique(column[order], axis=0, return_index=True)
    lowest = points[order[first]]
    bottom = float(np.quantile(points[:, 2], 0.002))
    low = np.sort(lowest[:, 2])
    # The lowest level in whose layer many columns begin; strays lie below it one by one.
    counts = np.searchsorted(low, low + 2 * FLOOR_TOLERANCE) - np.arange(len(low))
    enough = counts >= max(MIN_FLOOR_COLUMNS * len(low), 4)
    if not enough.any():
        return np.array([0.0, 0.0, bottom]), False
    start = int(np.argmax(enough))
    window = slice(start, start + max(1, int(np.searchsorted(low, low[start] + 0.1)) - start))
    level = low[window][int(counts[window].argmax())] + FLOOR_TOLERANCE
    design = np.column_stack([lowest[:, :2], np.ones(len(lowest))])
    plane = np.array([0.0, 0.0, level])
    for tolerance in (0.1, 0.06, FLOOR_TOLERANCE):
        near = np.abs(lowest[:, 2] - design @ plane) <= tolerance
        if near.sum() < 6:
            break
        fitted = np.linalg.lstsq(design[near], lowest[near, 2], rcond=None)[0]
        if np.hypot(*fitted[:2]) > MAX_FLOOR_SLOPE:
            break
        plane = fitted
    on_it = np.abs(lowest[:, 2] - design @ plane) <= FLOOR_TOLERANCE
    if not _is_wide(column[order[first]][on_it]):
        return np.array([0.0, 0.0, bottom]), False
    near = np.abs(points[:, 2] - points[:, :2] @ plane[:2] - plane[2]) <= FLOOR_TOLERANCE
    if near.sum() >= 6:  # Lowest points lie below the middle of a noisy layer.
        plane = plane + [0.0, 0.0, float(np.median((points[:, 2] - points[:, :2] @ plane[:2] - plane[2])[near]))]
    return plane, True


def _is_wide(columns: np.ndarray) -> bool:
    """Test whether columns (N, 2) cover an area, with others on all four sides; lower edges of walls are lines."""
    codes = (columns + 1) @ np.array([1 << 32, 1])
    around = [np.isin(codes + step, codes) for step in (1, -1, 1 << 32, -(1 << 32))]
    return bool(len(codes)) and float(np.logical_and.reduce(around).mean()) > MIN_FLOOR_INSIDE


def _ceiling(points: np.ndarray, height: np.ndarray, normals: np.ndarray) -> np.ndarray:
    """Mark voxels (V,) of the highest wide level layer and above."""
    nothing = np.zeros(len(points), dtype=bool)
    level = (np.abs(normals[:, 2]) > LEVEL) & (height > MIN_CEILING_HEIGHT)
    if not level.any():
        return nothing
    cells = _plan_cells(points)
    footprint = len(np.unique(cells))
    steps = np.floor(height[level] / _CELL).astype(np.int64)
    for step in np.unique(steps)[::-1]:
        layer = (steps == step) | (steps == step - 1)
        if len(np.unique(cells[level][layer])) >= MIN_CEILING_AREA * footprint:
            return np.asarray(height > np.quantile(height[level][layer], 0.02) - FLOOR_TOLERANCE)
    return nothing


def _walls(
    points: np.ndarray, height: np.ndarray, normals: np.ndarray, gone: np.ndarray, planarity: np.ndarray
) -> list[np.ndarray]:
    """List masks (V,) of the walls and of what lies beyond the outer ones."""
    upright = (np.abs(normals[:, 2]) < UPRIGHT) & (planarity > 0.3) & ~gone
    if upright.sum() < 100:
        return []
    angle = np.arctan2(normals[upright, 1], normals[upright, 0]) % np.pi
    votes = np.bincount((angle / np.pi * _ANGLES).astype(np.int64) % _ANGLES, minlength=_ANGLES).astype(float)
    votes = votes + np.roll(votes, 1) + np.roll(votes, -1)
    result: list[np.ndarray] = []
    for _ in range(4):
        peak = int(votes.argmax())
        if votes[peak] < 0.05 * upright.sum():
            break
        middle = (peak + 0.5) * np.pi / _ANGLES
        offset = (angle - middle + np.pi / 2) % np.pi - np.pi / 2
        exact = middle + float(np.median(offset[np.abs(offset) < 1.5 * np.pi / _ANGLES]))
        result += _parallel_walls(points, height, normals, upright, exact)
        votes[(peak + np.arange(-4, 5)) % _ANGLES] = 0.0
    return result


def _parallel_walls(
    points: np.ndarray, height: np.ndarray, normals: np.ndarray, upright: np.ndarray, angle: float
) -> list[np.ndarray]:
    """List masks (V,) of walls whose normal is at this angle (radians) about the up axis."""
    normal = np.array([np.cos(angle), np.sin(angle)])
    distance, along = points[:, :2] @ normal, points[:, :2] @ np.array([-normal[1], normal[0]])
    facing = upright & (np.abs(normals[:, :2] @ normal) > np.cos(np.radians(15.0)))
    if facing.sum() < 50:
        return []
    step = WALL_TOLERANCE / 2
    index = np.floor((distance - distance.min()) / step).astype(np.int64)
    counts = np.bincount(index[facing], minlength=int(index.max()) + 1).astype(float)
    layers = np.convolve(counts, np.ones(3), mode="same")
    found = []
    while layers.max() >= 30:
        peak = int(layers.argmax())
        layers[max(0, peak - 3) : peak + 4] = 0.0
        near = facing & (np.abs(index - peak) <= 2)
        level = float(np.median(distance[near]))
        near = facing & (np.abs(distance - level) <= WALL_TOLERANCE)
        outer = _is_wall(distance - level, along, height, near)
        if outer is None:
            continue
        lateral = (along > along[near].min() - 0.1) & (along < along[near].max() + 0.1)
        aligned = (np.abs(normals[:, :2] @ normal) > 0.8) | ~upright
        mask = lateral & aligned & (np.abs(distance - level) <= WALL_TOLERANCE)
        if outer:
            mask |= outer * (distance - level) > WALL_TOLERANCE
        found.append(mask)
    return found


def _is_wall(depth: np.ndarray, along: np.ndarray, height: np.ndarray, near: np.ndarray) -> float | None:
    """Judge an upright layer: 1 or -1, the outer side of an outer wall; 0 for a partition; None for no wall."""
    width = float(np.ptp(np.quantile(along[near], [0.02, 0.98])))
    top = float(np.quantile(height[near], 0.97))
    cells = np.unique(np.floor(np.column_stack([along[near], height[near]]) / _CELL).astype(np.int64), axis=0)
    area = len(cells) * _CELL**2
    beyond = [float((side * depth > WALL_TOLERANCE).mean()) for side in (1.0, -1.0)]
    room_top = float(np.quantile(height, 0.99))
    # A camera in the hand often sees no more than the lower half of the walls; they are the ends of the room then.
    low_wall = min(beyond) < END and top > LOW_WALL[0] * room_top and width > LOW_WALL[1] * float(np.ptp(along))
    if width < MIN_WALL_WIDTH or area < MIN_WALL_AREA or (top < MIN_WALL_TOP and not low_wall):
        return None
    if min(beyond) <= MAX_OUTSIDE:
        # The front of a wardrobe has the room's wall beside it, a hand's breadth to an arm's length behind.
        return 1.0 if beyond[0] <= beyond[1] else -1.0
    is_partition = width > 2.0 and top > 0.85 * room_top and area > 3.0
    low, high = np.quantile(along[near], [0.02, 0.98])
    before = (along > low + 0.1) & (along < high - 0.1)
    behind = min(int((before & (side * depth > WALL_TOLERANCE)).sum()) for side in (1.0, -1.0))
    # Where a room is no rectangle, a wall has nothing behind itself, though the room goes on beside it.
    is_inner = top > INNER_TOP * room_top and area > MIN_WALL_AREA and behind < MAX_BEHIND * near.sum()
    return 0.0 if is_partition or is_inner else None


def _plan_cells(points: np.ndarray) -> np.ndarray:
    index = np.floor((points[:, :2] - points[:, :2].min(axis=0)) / COLUMN).astype(np.int64)
    codes: np.ndarray = index[:, 0] * (int(index[:, 1].max()) + 1) + index[:, 1]
    return codes
