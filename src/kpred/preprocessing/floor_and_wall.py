"""Remains of the room in the scan of one object: pieces of the floor below it and of the wall behind it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from kpred.ops.typing import Bool, Float
from kpred.preprocessing.normals import neighbour_normals
from kpred.preprocessing.outliers import Neighbourhood, outside_hull
from kpred.preprocessing.planes import Sheet, end_sheet, own_points

WALLED_FLOOR = 0.45
"""Share of its outline along which a body must stand on the floor for its inside to be its own: two of four sides."""

WALLED_BACK = 0.7
"""The same at a wall: top and two legs of a table stand along three of four sides there, and it has no back."""

LONGEST_PLATE, LONGEST_ARM = 0.33, 0.5
"""How far from a single column its foot may reach, as a share of the scan's size."""

STAR_SHARE = 0.42
"""What the arms of a star cover at most of the disc around it."""


@dataclass(frozen=True)
class Stub:
    """A piece of the room in a scan.

    Attributes:
        points: (N,) True for what is to be removed.
        sheet: where it lies.
        beyond: how far it reaches beyond the object, as area over the object's outline (floor) or as a share of the
            scan's size (wall).
    """

    points: Bool[np.ndarray, " points"]
    sheet: Sheet
    beyond: float


def floor_stub(
    points: Float[np.ndarray, "points 3"],
    reach: Float[np.ndarray, " points"],
    up: Float[np.ndarray, "3"],
    size: float,
    least_beyond: float,
    elsewhere: Bool[np.ndarray, " points"] | None = None,
    sheet: Sheet | None = None,
) -> Stub | None:
    """A sheet at the bottom that reaches beyond the object's footprint; None if there is none.

    A sheet that stays within the footprint is the object's own (plinth, bottom board, plate), and so is anything
    narrow (feet, sled bars, arms of a star), and what lies close around a single column.

    Args:
        reach: each point's distance to its neighbours, see `Neighbourhood`.
        up: unit vector.
        size: of the scan, in its units.
        least_beyond: least area outside of the footprint, as a share of the footprint's.
        elsewhere: points known not to be the object's, such as the wall.
    """
    sheet = sheet or end_sheet(points, reach, up, size)
    if sheet is None:
        return None
    rest = sheet.height > 1.5 * sheet.thickness
    if elsewhere is not None:
        rest &= ~elsewhere
    # With next to nothing above it the sheet is the object.
    if rest.sum() < max(24, 0.1 * len(points)):
        return None
    outside = outside_hull(sheet.plane, _trimmed(sheet.plane[rest]))
    out = sheet.wide & (outside > 0.02 * size)
    footprint = sheet.area(rest)
    beyond = sheet.area(out) / max(footprint, sheet.cell**2)
    if beyond < least_beyond or out.sum() < 0.08 * sheet.wide.sum():
        return None
    if _is_foot(sheet, rest, size):
        return None
    removed = (sheet.inside | (sheet.height < -sheet.thickness)) & ~own_points(sheet, rest, size, WALLED_FLOOR)
    return Stub(removed, sheet, beyond)


def wall_stub(
    points: Float[np.ndarray, "points 3"],
    reach: Float[np.ndarray, " points"],
    up: Float[np.ndarray, "3"],
    size: float,
    least_beyond: float,
    directions: list[np.ndarray],
    standing: Bool[np.ndarray, " points"],
) -> Stub | None:
    """A vertical sheet at one side that reaches beyond the object; None if there is none.

    It must reach beyond the object on both sides, or on one side and above: a chair's back reaches above the rest of
    the chair only, and of two sides of a cabinet seen over their corner each reaches beyond the other on one side.

    Args:
        directions: unit vectors from possible walls to the object, see `wall_directions`.
        least_beyond: least reach on the second farthest side, as a share of the size; others as for `floor_stub`.
        standing: points that are not in a sheet at the bottom: a floor may reach behind the wall.
    """
    best: Stub | None = None
    for inward in directions:
        sheet = end_sheet(points, reach, inward, size, among=standing)
        if sheet is None:
            continue
        rest = standing & (sheet.height > 1.5 * sheet.thickness)
        if rest.sum() < max(24, 0.1 * len(points)):
            continue
        # An object is not thin: what lies within a few centimetres of the sheet is its frame or its mouldings.
        if np.quantile(sheet.height[rest], 0.9) < 0.1 * size:
            continue
        beyond = _reach_beyond(points, sheet, rest, up, size)
        if beyond < least_beyond or (best is not None and beyond <= best.beyond):
            continue
        removed = (sheet.inside | (sheet.height < -sheet.thickness)) & ~own_points(sheet, rest, size, WALLED_BACK)
        if removed.sum() <= 0.75 * len(points):
            best = Stub(removed, sheet, beyond)
    return best


def _reach_beyond(points: np.ndarray, sheet: Sheet, rest: np.ndarray, up: np.ndarray, size: float) -> float:
    """The lesser of the two farthest of: beyond the rest to the left, to the right, above; share of the size."""
    lateral = points @ np.cross(up, sheet.normal)
    level = points @ up
    low, high = np.quantile(lateral[rest], [0.005, 0.995])
    top = float(np.quantile(level[rest], 0.995))
    wide_lateral, wide_level = lateral[sheet.wide], level[sheet.wide]
    # The reach of the outermost few points says nothing.
    left = low - float(np.quantile(wide_lateral, 0.03))
    right = float(np.quantile(wide_lateral, 0.97)) - high
    above = float(np.quantile(wide_level, 0.97)) - top
    second = float(np.sort([left, right, above])[1])
    return second / size if max(left, right) > 0 else 0.0


def wall_directions(
    points: Float[np.ndarray, "points 3"], near: Neighbourhood, up: Float[np.ndarray, "3"]
) -> list[np.ndarray]:
    """Horizontal unit vectors that lead away from planes which many points of vertical surfaces lie on."""
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


def _is_foot(sheet: Sheet, rest: np.ndarray, size: float) -> bool:
    """Whether the sheet is the plate, ring or star under a single column, as of a swivel chair or a bar stool."""
    above = rest & (sheet.height > 0.09 * size) & (sheet.height <= 0.2 * size)
    if above.sum() < 3:
        return False
    center = np.median(sheet.plane[above], axis=0)
    column = np.linalg.norm(sheet.plane[above] - center, axis=1)
    foot = np.linalg.norm(sheet.plane[sheet.inside] - center, axis=1)
    longest = float(np.quantile(foot, 0.97))
    if np.quantile(column, 0.9) > 0.08 * size or longest > LONGEST_ARM * size:
        return False
    return longest < LONGEST_PLATE * size or sheet.area(sheet.inside) < STAR_SHARE * np.pi * longest**2


def _trimmed(plane: np.ndarray) -> np.ndarray:
    """Without the outermost half percent: one stray point must not widen the outline."""
    if len(plane) < 400:
        return plane
    distance = np.linalg.norm(plane - plane.mean(axis=0), axis=1)
    kept: np.ndarray = plane[distance <= np.quantile(distance, 0.995)]
    return kept
