"""Cleaning a scan of one object: from what a scanner and a crop leave in it to points of the object, evenly spread."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from kpred.errors import ConfigError, ScanError
from kpred.ops.rotations import UP_AXES
from kpred.ops.typing import Bool, Float
from kpred.preprocessing.config import LEAST_POINTS, CleanConfig
from kpred.preprocessing.downsample import poisson_disc, voxel_representatives
from kpred.preprocessing.floor_and_wall import floor_stub, wall_directions, wall_stub
from kpred.preprocessing.normals import estimate_normals, orient_normals
from kpred.preprocessing.outliers import Neighbourhood, duplicate_points, island_points, neighbourhood, stray_points
from kpred.preprocessing.planes import end_sheet

WORKING_POINTS = 4500
"""Larger scans are judged by this many of their points, one for each cell of a grid."""


@dataclass(frozen=True)
class CleaningStep:
    """What one step did: its name, how many points it removed, and why or why not."""

    name: str
    removed: int
    detail: str


@dataclass(frozen=True)
class CleanedScan:
    """A cleaned scan.

    Attributes:
        points: (M, 3) that are left, in the scan's own frame, units and order; M >= 64 if N >= 64.
        kept: (N,) which points of the scan they are.
        steps: what each step did, in order.
        floor_height: of the removed piece of floor, along the up axis, below the middle of the object; None if no floor
            was seen.
        normals: (M, 3) unit vectors, if asked for.
        object_points: (N,) points of the scan that are the object's: `kept` before thinning.
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
) -> CleanedScan:
    """Remove what is not the object from the scan of one object, and even out its density.

    Args:
        points: in any unit, finite.
        up: the scan's up axis, one of x, y, z, -x, -y, -z.
        config: the steps.
        sensor: where the scanner stood, in the scan's frame; turns the normals.
        seed: of the thinning.

    Raises:
        ConfigError: if `up` is no axis name.
        ScanError: if a coordinate is not finite.
    """
    if up not in UP_AXES:
        raise ConfigError(f"The up axis must be one of {', '.join(UP_AXES)}, but is '{up}'.")
    if not np.isfinite(points).all():
        raise ScanError("The scan has coordinates that are NaN or infinite; remove those points first.")
    cleaning = _Cleaning(points, np.array(UP_AXES[up], dtype=np.float64), config)
    if config.duplicates:
        cleaning.remove_duplicates()
    if config.outliers or config.floor or config.wall:
        cleaning.remove_what_is_not_the_object()
    object_points = cleaning.kept.copy()
    if config.density:
        cleaning.thin(seed)
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
    """The state of one cleaning: which points are still kept, and what was reported."""

    def __init__(self, points: np.ndarray, up: np.ndarray, config: CleanConfig) -> None:
        self.points, self.up, self.config = points, up, config
        self.kept = np.ones(len(points), dtype=bool)
        self.steps: list[CleaningStep] = []
        self.floor_height: float | None = None

    def remove_duplicates(self) -> None:
        self._remove("duplicates", duplicate_points(self.points), "exact repeats of an earlier point")

    def remove_what_is_not_the_object(self) -> None:
        names = [name for name in ("outliers", "floor", "wall") if getattr(self.config, name)]
        rows = np.flatnonzero(self.kept)
        cell = np.arange(len(rows))
        if len(rows) > 1.2 * WORKING_POINTS:
            chosen, cell, _ = voxel_representatives(self.points[rows], WORKING_POINTS)
            working = self.points[rows[chosen]]
        else:
            working = self.points[rows]
        if len(working) <= LEAST_POINTS or _size(working) <= 0:
            self.steps += [CleaningStep(name, 0, "skipped: too few points or no extent") for name in names]
            return
        # Near the origin and of size one, whatever the scan's unit and place.
        middle, scale = working.mean(axis=0), _size(working)
        working = (working - middle) / scale
        everything = np.ones(len(working), dtype=bool)
        near = neighbourhood(working)
        stray = stray_points(near, 1.0, self.config.outlier_ratio)
        alive = ~stray if len(working) - stray.sum() >= LEAST_POINTS else everything.copy()
        if self.config.outliers:
            self._remove("outliers", self._of(stray, rows, cell), "strays far from their neighbours")
        if (self.config.floor or self.config.wall) and alive.sum() > LEAST_POINTS:
            before = alive
            alive = self._remove_room(working, near, alive, rows, cell, middle, scale)
            if alive.sum() < before.sum():
                # What is left of floor and wall, their noise and what was close to them, now stands alone.
                working, cell = working[alive], np.where(alive, np.cumsum(alive) - 1, -1)[cell]
                rows, cell = rows[cell >= 0], cell[cell >= 0]
                near, alive = neighbourhood(working), np.ones(len(working), dtype=bool)
                stray = stray_points(near, _size(working), self.config.outlier_ratio)
                if self.config.outliers and self._remove(
                    "outliers", self._of(stray, rows, cell), "after floor and wall"
                ):
                    alive = ~stray
        if self.config.outliers and alive.sum() > LEAST_POINTS:
            shares = self.config.speck_share, self.config.island_share
            island = island_points(working, near, alive, self.up, 1.0, *shares)
            self._remove("islands", self._of(island, rows, cell), "small components far from the rest")

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
        """Floor and wall; each is looked for as if the other were not there."""
        config = self.config
        chosen = np.flatnonzero(alive)
        left = working[chosen]
        reach = near.reach[chosen]
        size = _size(left)
        # A floor that lies under a wall too would hide how far the wall reaches, and a wall that of the floor.
        bottom = end_sheet(left, reach, self.up, size)
        directions = wall_directions(working, near, self.up)
        standing = np.ones(len(left), dtype=bool) if bottom is None else ~bottom.inside
        wall = wall_stub(left, reach, self.up, size, config.wall_beyond, directions, standing)
        behind = None if wall is None else wall.sheet.height <= 1.5 * wall.sheet.thickness
        floor = floor_stub(left, reach, self.up, size, config.floor_beyond, behind, bottom)
        for name, stub, beyond in (("floor", floor, "times its footprint"), ("wall", wall, "of the scan's size")):
            if not getattr(config, name):
                continue
            if stub is None:
                self.steps.append(CleaningStep(name, 0, f"no piece of a {name} that reaches beyond the object"))
                continue
            gone = np.zeros(len(working), dtype=bool)
            gone[chosen[stub.points]] = True
            done = self._remove(
                name, self._of(gone, rows, cell), f"reached beyond the object by {stub.beyond:.2f} {beyond}"
            )
            if done:
                alive = alive & ~gone
            if name == "floor":
                self.floor_height = self._height_of(stub.sheet.height, left, middle, scale)
        return alive

    def _height_of(self, above: np.ndarray, left: np.ndarray, middle: np.ndarray, scale: float) -> float:
        # Of a leaning sheet: its level below the object's middle.
        horizontal = left - (left @ self.up)[:, None] * self.up
        rest = above > np.median(above)
        center = horizontal[rest].mean(axis=0)
        nearest = np.argsort(((horizontal - center) ** 2).sum(axis=1))[:16]
        level = float(np.median(left[nearest] @ self.up - above[nearest]))
        return level * scale + float(middle @ self.up)

    def thin(self, seed: int) -> None:
        rows = np.flatnonzero(self.kept)
        least = self.config.points
        chosen = rows
        if len(rows) > 5 * least:
            # The grid is several times finer than the distance that follows, so that it leaves no trace.
            chosen = rows[voxel_representatives(self.points[rows], 4 * least)[0]]
        subset, distance = poisson_disc(self.points[chosen], least, seed)
        if distance == 0.0:
            self.steps.append(CleaningStep("density", 0, f"{len(rows)} points are too few to thin"))
            return
        gone = self.kept.copy()
        gone[chosen[subset]] = False
        self._remove("density", gone, f"points at least {distance:.4g} apart, in the scan's unit")

    def _of(self, gone: np.ndarray, rows: np.ndarray, cell: np.ndarray) -> np.ndarray:
        """Mask over the scan of a mask over the working points."""
        result = np.zeros(len(self.points), dtype=bool)
        result[rows[gone[cell]]] = True
        return result

    def _remove(self, name: str, gone: np.ndarray, detail: str) -> bool:
        """Unless that would leave too few points."""
        gone = gone & self.kept
        removed = int(gone.sum())
        if removed and self.kept.sum() - removed < LEAST_POINTS:
            self.steps.append(CleaningStep(name, 0, f"backed off: it would leave fewer than {LEAST_POINTS} points"))
            return False
        self.kept &= ~gone
        self.steps.append(CleaningStep(name, removed, detail if removed else "nothing to remove"))
        return True


def _size(points: np.ndarray) -> float:
    """Extent of a cloud that neither its rotation nor a few strays change."""
    distance = np.linalg.norm(points - points.mean(axis=0), axis=1)
    return 2.0 * float(np.quantile(distance, 0.98))
