"""The floor of a scanned scene: a nearly level plane, from labels where there are any, else from the points."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np

from kpred.ops.typing import Float
from kpred.scenes.objects import SceneObject
from kpred.scenes.scene import Scene
from kpred.shapes.categories import NYU40

MAX_FOOT_HEIGHT = 1.2
"""Metres: an object whose lowest point is farther above the floor hangs or lies on something."""

MAX_TILT = 0.1
"""Rise over run of a floor: scans bend and lean by a few degrees."""

MIN_FLOOR_FRACTION = 0.15
"""Of the scene's footprint that a floor without labels must cover."""

MAX_BELOW_FRACTION = 0.03
"""Of the scene that may lie below its floor: stray points and reflections."""

_COLUMNS = (20, 120)
"""Least and most columns along the longer side of the footprint in which the lowest points are looked for."""

_MIN_COLUMNS = 12
_MIN_INSIDE = 0.2
"""Of a floor's coarse cells that must have floor on all four sides: lower edges of walls are level, but only lines."""

_TRIALS = 200
_ROOM = 2.5
"""Typical height of a scanned room in metres, to estimate the scene's unit."""

_UNITS = (1.0, 0.01, 0.001)


@dataclass(frozen=True, eq=False)
class SceneFloor:
    """A plane on which objects stand, in the scene's frame and units.

    Attributes:
        up: the scene's up axis (x, y, z, -x, -y, -z), along which heights are measured.
        level: height of the plane at the origin; slope: (2,) its rise along the two other axes, in the order x, y, z.
        source: `labels` or `points`.
        metres: length of the scene's unit, estimated from the scene's height.
    """

    up: str
    level: float
    slope: Float[np.ndarray, "2"]
    source: Literal["labels", "points"]
    metres: float = 1.0

    def height_under(self, points: Float[np.ndarray, "points 3"]) -> float:
        """Return the height of the floor, along the up axis, below the middle of an object's points."""
        plan = _plan(points, self.up)
        return float(self.level + (plan.min(axis=0) + plan.max(axis=0)) / 2 @ self.slope)

    def carries(self, points: Float[np.ndarray, "points 3"]) -> bool:
        """Test whether an object with these points stands on the floor, even if its feet were not scanned.

        Furniture does, unless its lowest points are more than `MAX_FOOT_HEIGHT` above the floor, as those of wall
        cupboards are.
        """
        lowest = float(np.quantile(_heights(points, self.up), 0.01))
        return (lowest - self.height_under(points)) * self.metres <= MAX_FOOT_HEIGHT


def find_floor(scene: Scene, objects: Sequence[SceneObject] = (), seed: int = 0) -> SceneFloor | None:
    """Find the floor of a scene, or None.

    Uses points labelled floor, by the scene's NYU40 labels or by an object of the category `floor`. Without these, it
    is the lowest nearly level plane that covers at least `MIN_FLOOR_FRACTION` of the footprint, with at most
    `MAX_BELOW_FRACTION` of the scene below; points of the objects are excluded, since tops of tables are level too.

    Args:
        objects: what stands in the scene (`kpred.scenes.objects.objects_of`).
        seed: of the search for the plane.
    """
    finite = np.isfinite(scene.points).all(axis=1)
    points = scene.points[finite]
    height = _heights(points, scene.up)
    low, high = np.quantile(height, [0.005, 0.995])
    tolerance = max(0.015 * float(high - low), 0.003 * float(np.ptp(_plan(points, scene.up), axis=0).max()))
    metres = min(_UNITS, key=lambda unit: abs(np.log(max(float(high - low), 1e-12) * unit / _ROOM)))
    labelled = [item.points for item in objects if item.category == "floor"]
    if scene.labels is not None:
        labelled.append(scene.points[finite & (scene.labels == NYU40.index("floor"))])
    known = np.concatenate([np.zeros((0, 3)), *labelled])
    plane = _plane(*_lowest(known, scene.up, points), tolerance, seed) if len(known) else None
    if plane is not None:
        return SceneFloor(scene.up, float(plane[2]), plane[:2], "labels", metres)
    apart = np.ones(len(scene.points), dtype=bool)
    for item in objects:
        apart[item.indices[item.indices >= 0]] = False
    plan, lowest = _lowest(scene.points[finite & apart], scene.up, points)
    plane = _plane(plan, lowest, tolerance, seed)
    if plane is None:
        return None
    on_it = np.abs(lowest - plan @ plane[:2] - plane[2]) <= tolerance
    footprint = len(_lowest(points, scene.up, points)[1])
    solid = _downsampled(points, scene.up)
    below = _heights(solid, scene.up) < _plan(solid, scene.up) @ plane[:2] + plane[2] - 2 * tolerance
    if (
        on_it.sum() < MIN_FLOOR_FRACTION * footprint
        or _inside(plan[on_it]) < _MIN_INSIDE
        or below.mean() > MAX_BELOW_FRACTION
    ):
        return None
    return SceneFloor(scene.up, float(plane[2]), plane[:2], "points", metres)


def _heights(points: np.ndarray, up: str) -> np.ndarray:
    height = points[:, "xyz".index(up[-1])]
    return -height if up.startswith("-") else height


def _plan(points: np.ndarray, up: str) -> np.ndarray:
    return points[:, [axis for axis in range(3) if axis != "xyz".index(up[-1])]]


def _cell_size(whole: np.ndarray, up: str) -> float:
    """Return the width of the columns: about ten points lie in each, where points are evenly spread."""
    columns = np.clip(np.sqrt(len(whole)) / 3, *_COLUMNS)
    return max(float(np.ptp(_plan(whole, up), axis=0).max() / columns), 1e-12)


def _inside(plan: np.ndarray) -> float:
    """Measure the fraction of coarse cells of an area (N, 2) with four neighbours in it; 0 for lines."""
    extent = np.ptp(plan, axis=0)
    size = max(float(extent.min()) / 8, float(extent.max()) / 60, 1e-12)
    cells = np.unique(np.floor((plan - plan.min(axis=0)) / size).astype(np.int64), axis=0) + 1
    codes = cells @ np.array([1 << 32, 1])
    around = [np.isin(codes + step, codes) for step in (1, -1, 1 << 32, -(1 << 32))]
    return float(np.logical_and.reduce(around).mean())


def _lowest(points: np.ndarray, up: str, whole: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Place (columns, 2) and height (columns,) of the lowest points in upright columns of one size.

    What is lowest does not depend on how densely the scanner saw it.
    """
    if not len(points):
        return np.zeros((0, 2)), np.zeros(0)
    plan, height = _plan(points, up), _heights(points, up)
    cell = np.floor((plan - _plan(whole, up).min(axis=0)) / _cell_size(whole, up)).astype(np.int64)
    order = np.argsort(height, kind="stable")
    _, first = np.unique(cell[order], axis=0, return_index=True)
    rows = order[first]
    return plan[rows], height[rows]


def _downsampled(points: np.ndarray, up: str) -> np.ndarray:
    """Select one point of each cube of a column's width."""
    cell = np.floor((points - points.min(axis=0)) / _cell_size(points, up)).astype(np.int64)
    return np.asarray(points[np.unique(cell, axis=0, return_index=True)[1]])


def _plane(plan: np.ndarray, height: np.ndarray, tolerance: float, seed: int) -> np.ndarray | None:
    """Fit slopes and level (3,) of the nearly level plane of most points; None if too few lie on it."""
    if len(height) < _MIN_COLUMNS:
        return None
    rng = np.random.default_rng(seed)
    rows = np.column_stack([plan, np.ones(len(plan))])
    best, max_count = None, 0
    for trial in range(_TRIALS):
        # Level planes through single points first: nearly all floors are found by these.
        if trial % 2 == 0:
            found = np.array([0.0, 0.0, height[rng.integers(len(height))]])
        else:
            three = rng.choice(len(height), 3, replace=False)
            if abs(np.linalg.det(rows[three])) < 1e-9 * max(float(np.abs(plan).max()), 1e-12) ** 2:
                continue
            found = np.linalg.solve(rows[three], height[three])
        if np.hypot(found[0], found[1]) > MAX_TILT:
            continue
        on_it = int((np.abs(rows @ found - height) <= tolerance).sum())
        if on_it > max_count:
            best, max_count = found, on_it
    if best is None or max_count < _MIN_COLUMNS:
        return None
    for _ in range(4):
        on_it = np.abs(rows @ best - height) <= tolerance
        # Columns in one line do not determine the slope across it: a small regularisation keeps it level.
        pull = 1e-3 * np.diag([1.0, 1.0, 0.0]) * float(np.square(plan - plan.mean(axis=0)).sum())
        middle = rows[on_it] - np.array([*plan.mean(axis=0), 0.0])
        slopes = np.linalg.solve(middle.T @ middle + pull, middle.T @ height[on_it])
        best = np.array([slopes[0], slopes[1], slopes[2] - slopes[:2] @ plan.mean(axis=0)])
    return np.asarray(best) if np.hypot(best[0], best[1]) <= MAX_TILT else None
