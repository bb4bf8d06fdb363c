"""Cleaning of the scan of one object: removes outliers, floor and wall, and evens out the density."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from kpred.errors import ConfigError, ScanError
from kpred.ops.rotations import UP_AXES
from kpred.ops.typing import Bool, Float
from kpred.preprocessing.config import MIN_POINTS, CleanConfig
from kpred.preprocessing.downsample import poisson_disc, voxel_representatives
from kpred.preprocessing.floor_and_wall import RoomSurface, detect_floor, detect_wall, wall_directions
from kpred.preprocessing.floor_in_box import detect_floor_in_box
from kpred.preprocessing.normals import estimate_normals, orient_normals
from kpred.preprocessing.outliers import (
    SPARSE_RATIO,
    Neighbourhood,
    duplicate_points,
    island_points,
    neighbourhood,
    stray_points,
)
from kpred.preprocessing.planes import find_end_patch

WORKING_POINTS = 4500
"""Larger scans are represented by this many points, one for each cell of a grid."""

MANY_STRAYS = 0.03
"""Fraction of strays above which the rest is looked at anew without them."""

STRAY_RATIO = 4.0
"""Minimum reach of a stray where there are many, in place of `SPARSE_RATIO`."""

FEW_MEMBERS, MANY_CELLS = 0.15, 0.2
"""Cells with so few points, in means of all, and the fraction of such cells above which there may be many strays."""

MAX_ABOVE_FLOOR = 0.1
"""Planes farther above the known floor, in sizes of the scan, are no floor."""


@dataclass(frozen=True)
class CleaningStep:
    """Report of one step: its name, the number of points removed, and the reason."""

    name: str
    removed: int
    detail: str


@dataclass(frozen=True)
class CleanedScan:
    """A cleaned scan.

    Attributes:
        points: (M, 3) remaining points, in the scan's own frame, units and order; M >= 64 if N >= 64.
        kept: (N,) mask of the remaining points.
        steps: report of each step, in order.
        floor_height: height of the removed floor along the up axis, below the middle of the object; None without floor.
        normals: (M, 3) unit vectors, if configured.
        object_points: (N,) mask of the object's points: `kept` before downsampling.
    """

    points: Float[np.ndarray, "kept 3"]
    kept: Bool[np.ndarray, " points"]
    steps: tuple[CleaningStep, ...]
    floor_height: float | None
    normals: Float[np.ndarray, "kept 3"] | None
    object_points: Bool[np.ndarray, " points"]


def clean_scan(
    points: Float[np.ndarray, "points 3"],
    up: str = "y",
    config: CleanConfig = CleanConfig(),  # noqa: B008 - frozen
    sensor: Float[np.ndarray, "3"] | None = None,
    seed: int = 0,
    floor: float | None = None,
) -> CleanedScan:
    """Clean the scan (N, 3) of one object: remove everything else and even out the density.

    Args:
        points: in any unit, finite.
        up: the scan's up axis, one of x, y, z, -x, -y, -z.
        config: the steps.
        sensor: position of the scanner, in the scan's frame; orients the normals.
        seed: of the downsampling.
        floor: height of the floor along the up axis, scan's frame and unit, where it is known.

    Raises:
        ConfigError: if `up` is no axis name.
        ScanError: if a coordinate is not finite.
    """
    if up not in UP_AXES:
        raise ConfigError(f"The up axis must be one of {', '.join(UP_AXES)}, but is '{up}'.")
    if not np.isfinite(points).all():
        raise ScanError("The scan has coordinates that are NaN or infinite; remove those points first.")
    cleaning = _Cleaning(points, np.array(UP_AXES[up], dtype=np.float64), config, floor)
    if config.duplicates:
        cleaning.remove_duplicates()
    if config.outliers or config.floor or config.wall:
        cleaning.remove_surroundings()
    object_points = cleaning.kept.copy()
    if config.density:
        cleaning.downsample(seed)
    left = points[cleaning.kept]
    normals = None
    if config.normals:
        normals, _ = estimate_normals(left, neighbours=config.normal_neighbours)
        normals = orient_normals(normals, left, sensor)
        facing = "away from the middle" if sensor is None else "to the sensor"
        cleaning.steps.append(
            CleaningStep("normals", 0, f"from {config.normal_neighbours} neighbours, turned {facing}")
        )
    return CleanedScan(left, cleaning.kept, tuple(cleaning.steps), cleaning.floor_height, normals, object_points)


class _Cleaning:
    """State of one cleaning: mask of remaining points, and reports."""

    def __init__(self, points: np.ndarray, up: np.ndarray, config: CleanConfig, floor: float | None) -> None:
        self.points, self.up, self.config, self.floor = points, up, config, floor
        self.kept = np.ones(len(points), dtype=bool)
        self.steps: list[CleaningStep] = []
        self.floor_height: float | None = None
        self.sparse_ratio = SPARSE_RATIO

    def remove_duplicates(self) -> None:
        self._remove("duplicates", duplicate_points(self.points), "exact repeats of an earlier point")

    def remove_surroundings(self) -> None:
        names = [name for name in ("outliers", "floor", "wall") if getattr(self.config, name)]
        rows = np.flatnonzero(self.kept)
        cell = np.arange(len(rows))
        if len(rows) > 1.2 * WORKING_POINTS:
            chosen, cell, _ = voxel_representatives(self.points[rows], WORKING_POINTS)
            working = self.points[rows[chosen]]
        else:
            working = self.points[rows]
        if len(working) <= MIN_POINTS or _size(working) <= 0:
            self.steps += [CleaningStep(name, 0, "skipped: too few points or no extent") for name in names]
            return
        # Normalised to the origin and size one, independent of the scan's unit and place.
        middle, scale = working.mean(axis=0), _size(working)
        working = (working - middle) / scale
        everything = np.ones(len(working), dtype=bool)
        near = neighbourhood(working)
        stray = stray_points(near, 1.0, self.config.outlier_ratio, self.sparse_ratio)
        many = self._many_strays(stray, rows, cell) if self.config.outliers else None
        if many is not None and self._remove("outliers", many, "very many strays"):
            # Those that were left shielded each other, or thinned the surface out among the working points.
            self.sparse_ratio = STRAY_RATIO
            self.remove_surroundings()
            return
        alive = ~stray if len(working) - stray.sum() >= MIN_POINTS else everything.copy()
        if self.config.outliers:
            self._remove("outliers", self._scan_mask(stray, rows, cell), "strays far from their neighbours")
        if (self.config.floor or self.config.wall) and alive.sum() > MIN_POINTS:
            before = alive
            alive = self._remove_room(working, near, alive, rows, cell, middle, scale)
            if alive.sum() < before.sum():
                # Remains of floor and wall are isolated now.
                working, cell = working[alive], np.where(alive, np.cumsum(alive) - 1, -1)[cell]
                rows, cell = rows[cell >= 0], cell[cell >= 0]
                near, alive = neighbourhood(working), np.ones(len(working), dtype=bool)
                stray = stray_points(near, _size(working), self.config.outlier_ratio)
                if self.config.outliers and self._remove(
                    "outliers", self._scan_mask(stray, rows, cell), "after floor and wall"
                ):
                    alive = ~stray
        if self.config.outliers and alive.sum() > MIN_POINTS:
            fractions = self.config.speck_fraction, self.config.island_fraction
            island = island_points(working, near, alive, self.up, 1.0, *fractions)
            self._remove("islands", self._scan_mask(island, rows, cell), "small components far from the rest")

    def _many_strays(self, stray: np.ndarray, rows: np.ndarray, cell: np.ndarray) -> np.ndarray | None:
        """Return a mask (N,) of strays if there are many; None otherwise.

        Working points stand for cells, of which strays fill more than surfaces do: where many cells hold few points,
        all points are looked at.
        """
        if len(stray) == len(rows):
            found = stray
        else:
            members = np.bincount(cell)
            if np.mean(members <= max(1.0, FEW_MEMBERS * members.mean())) <= MANY_CELLS:
                return None
            points = self.points[rows] - self.points[rows].mean(axis=0)
            near = neighbourhood(points)
            found = stray_points(near, _size(points), self.config.outlier_ratio, self.sparse_ratio)
        if found.mean() <= MANY_STRAYS:
            return None
        result = np.zeros(len(self.points), dtype=bool)
        result[rows[found]] = True
        return result

    def _remove_room(
        self,
        working: np.ndarray,
        near: Neighbourhood,
        alive: np.ndarray,
        rows: np.ndarray,
        cell: np.ndarray,
        middle: np.ndarray,
        scale: float,
    ) -> np.ndarray:
        """Remove floor and wall, each detected without the other; return the mask of working points."""
        config = self.config
        chosen = np.flatnonzero(alive)
        left = working[chosen]
        reach = near.reach[chosen]
        size = _size(left)
        # A floor under a wall would hide the reach of the wall, and vice versa.
        bottom = find_end_patch(left, reach, self.up, size)
        directions = wall_directions(working, near, self.up)
        standing = np.ones(len(left), dtype=bool) if bottom is None else ~bottom.inside
        wall = detect_wall(left, reach, self.up, size, config.wall_beyond, directions, standing)
        behind = None if wall is None else wall.patch.height <= 1.5 * wall.patch.thickness
        above = None
        if bottom is not None and self.floor is not None:
            above = (self._height_of(bottom.height, left, middle, scale) - self.floor) / scale
        floor = None
        if above is None or above < MAX_ABOVE_FLOOR * size:  # Higher ones are tops of tables.
            floor = detect_floor(left, reach, self.up, size, config.floor_beyond, behind, bottom)
        if floor is None and bottom is not None:
            floor = detect_floor_in_box(bottom, self.up, size, above)
        for name, surface in (("floor", floor), ("wall", wall)):
            if not getattr(config, name):
                continue
            if surface is None:
                self.steps.append(CleaningStep(name, 0, f"no piece of a {name} that reaches beyond the object"))
                continue
            gone = np.zeros(len(working), dtype=bool)
            gone[chosen[surface.points]] = True
            if self._remove(name, self._scan_mask(gone, rows, cell), _reason(name, surface)):
                alive = alive & ~gone
            if name == "floor":
                self.floor_height = self._height_of(surface.patch.height, left, middle, scale)
        return alive

    def _height_of(self, above: np.ndarray, left: np.ndarray, middle: np.ndarray, scale: float) -> float:
        # Of a tilted patch: its level below the object's middle.
        horizontal = left - (left @ self.up)[:, None] * self.up
        rest = above > np.median(above)
        center = horizontal[rest].mean(axis=0)
        nearest = np.argsort(((horizontal - center) ** 2).sum(axis=1))[:16]
        level = float(np.median(left[nearest] @ self.up - above[nearest]))
        return level * scale + float(middle @ self.up)

    def downsample(self, seed: int) -> None:
        rows = np.flatnonzero(self.kept)
        min_count = self.config.points
        chosen = rows
        if len(rows) > 5 * min_count:
            # The grid is several times finer than the Poisson distance, so that it leaves no pattern.
            chosen = rows[voxel_representatives(self.points[rows], 4 * min_count).rows]
        subset, distance = poisson_disc(self.points[chosen], min_count, seed)
        if distance == 0.0:
            self.steps.append(CleaningStep("density", 0, f"{len(rows)} points are too few to thin"))
            return
        gone = self.kept.copy()
        gone[chosen[subset]] = False
        self._remove("density", gone, f"points at least {distance:.4g} apart, in the scan's unit")

    def _scan_mask(self, gone: np.ndarray, rows: np.ndarray, cell: np.ndarray) -> np.ndarray:
        """Map a mask over the working points to a mask (N,) over the scan."""
        result = np.zeros(len(self.points), dtype=bool)
        result[rows[gone[cell]]] = True
        return result

    def _remove(self, name: str, gone: np.ndarray, detail: str) -> bool:
        """Remove masked points, unless too few would remain; return whether it was done."""
        gone = gone & self.kept
        removed = int(gone.sum())
        if removed and self.kept.sum() - removed < MIN_POINTS:
            self.steps.append(CleaningStep(name, 0, f"backed off: it would leave fewer than {MIN_POINTS} points"))
            return False
        self.kept &= ~gone
        self.steps.append(CleaningStep(name, removed, detail if removed else "nothing to remove"))
        return True


def _reason(name: str, surface: RoomSurface) -> str:
    if not surface.beyond:
        return f"a bare {name} as wide as the object"
    beyond = "times its footprint" if name == "floor" else "of the scan's size"
    return f"reached beyond the object by {surface.beyond:.2f} {beyond}"


def _size(points: np.ndarray) -> float:
    """Measure the extent of a cloud, robust to rotation and outliers, in its unit."""
    distance = np.linalg.norm(points - points.mean(axis=0), axis=1)
    return 2.0 * float(np.quantile(distance, 0.98))
