"""Up direction and unit of a raw room: a floor at the lower end, walls upright, furniture in the lower half."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from kpred.detection.voxels import voxel_grid, without_strays
from kpred.ops.rotations import UP_AXES
from kpred.ops.typing import Float
from kpred.preprocessing.normals import estimate_normals

ROOM_HEIGHT = 2.4
"""Metres: height of a scanned room, by which units are distinguished; inches and feet must be named."""

UNITS = (1.0, 0.01, 0.001)
"""Metres of the units that scans come in."""

SAMPLE_VOXELS = 12_000
NEAR = 2.5
"""Cells within which those of surfaces have others."""

MAX_DIRECTIONS = 6
PEAK_ANGLE, APART_ANGLE = np.radians(6.0), np.radians(25.0)
"""Normals within the first of a direction vote for it; peaks are farther apart than the second."""

AXIS_ANGLE = np.radians(12.0)
"""A direction so close to an axis of the file has that axis' prior."""

PRIOR = {"z": 0.5, "y": 0.45, "-y": 0.25, "-z": 0.0, "x": 0.0, "-x": 0.0}
"""Evidence that files have z or y up, and cameras -y, in the unit of `_evidence`."""

WIDE_WEIGHT = 0.5
"""Of the evidence that rooms are wider than high."""

LOW_WEIGHT = 1.5
"""Of the evidence that furniture fills the lower half of a room."""

TALL = 0.6
"""Columns of which more of the height is filled are walls."""

CLEAR = 0.4
"""Evidence by which the best direction must be ahead of the second to be the only one."""

MIN_TILT = np.radians(1.5)
"""Directions closer than this to an axis are that axis: scans bend by as much."""


@dataclass(frozen=True, eq=False)
class Gravity:
    """Which way is up in a room.

    Attributes:
        direction: (3,) unit vector, scan's frame.
        axis: the axis of the scan nearest to it (x, y, z, -x, -y, -z).
        rotation: (3, 3) the smallest rotation that takes `direction` to `axis`; the identity for a level scan.
        metres: length of the scan's unit.
    """

    direction: Float[np.ndarray, "3"]
    axis: str
    rotation: Float[np.ndarray, "3 3"]
    metres: float

    @property
    def is_tilted(self) -> bool:
        """Whether the scan has to be rotated to stand upright along one of its axes."""
        return not np.array_equal(self.rotation, np.eye(3))


def find_gravity(points: Float[np.ndarray, "points 3"], up: str = "auto") -> Gravity:
    """Find the likeliest up direction and the unit of a room (N, 3); `up` names the axis where it is known."""
    return find_directions(points, up)[0]


def find_directions(
    points: Float[np.ndarray, "points 3"], up: str = "auto", metres: float | None = None
) -> list[Gravity]:
    """Find the likeliest up directions and the unit of a room (N, 3): one if it is clear, else two.

    Args:
        up: names the axis where it is known; metres: length of the unit where it is known.
    """
    finite = points[np.isfinite(points).all(axis=1)]
    low, high = np.quantile(finite[:: max(1, len(finite) // 100_000)], [0.01, 0.99], axis=0)
    size = max(float((high - low).max()), float(np.finfo(float).tiny))
    inside = finite[((finite >= low - 0.1 * size) & (finite <= high + 0.1 * size)).all(axis=1)]
    cells = voxel_grid(inside, size / 150, SAMPLE_VOXELS)
    grid = without_strays(cells, NEAR * cells.cell)
    if up != "auto":
        return [_gravity(np.array(UP_AXES[up], dtype=np.float64), grid.points, metres)]
    normals, planarity = estimate_normals(grid.points, neighbours=12)
    flat = normals[planarity > 0.4]
    axes = [np.array(axis, dtype=np.float64) for axis in UP_AXES.values()]
    peaks = _peaks(flat) if len(flat) >= 64 else []
    directions = [sign * peak for peak in peaks for sign in (1.0, -1.0)] or axes
    scores = [_prior(one) + _evidence(grid.points, normals, planarity, one) for one in directions]
    order = np.argsort(-np.array(scores), kind="stable")[:2]
    close = [row for row in order.tolist() if scores[row] > scores[order[0]] - CLEAR]
    return [_gravity(directions[row], grid.points, metres) for row in close]


def rotation_between(start: Float[np.ndarray, "3"], end: Float[np.ndarray, "3"]) -> Float[np.ndarray, "3 3"]:
    """Return the smallest rotation (3, 3) that takes one unit vector to another, not opposite, one."""
    cross, cosine = np.cross(start, end), float(start @ end)
    skew = np.array([[0, -cross[2], cross[1]], [cross[2], 0, -cross[0]], [-cross[1], cross[0], 0]])
    return np.asarray(np.eye(3) + skew + skew @ skew / (1.0 + cosine))


def _gravity(direction: np.ndarray, points: np.ndarray, metres: float | None) -> Gravity:
    axis = max(UP_AXES, key=lambda name: float(np.array(UP_AXES[name]) @ direction))
    upright = np.array(UP_AXES[axis], dtype=np.float64)
    level = float(upright @ direction) > np.cos(MIN_TILT)
    chosen = upright if level else direction / np.linalg.norm(direction)
    rotation = np.eye(3) if level else rotation_between(chosen, upright)
    height = points @ chosen
    extent = max(float(np.ptp(np.quantile(height, [0.005, 0.995]))), float(np.finfo(float).tiny))
    guessed = min(UNITS, key=lambda unit: abs(float(np.log(extent * unit / ROOM_HEIGHT))))
    return Gravity(chosen, axis, rotation, guessed if metres is None else metres)


def _peaks(normals: np.ndarray) -> list[np.ndarray]:
    """Find the directions, up to sign, that most normals share; the strongest first."""
    found: list[np.ndarray] = []
    candidates = normals[:: max(1, len(normals) // 400)]
    votes = (np.abs(candidates @ normals.T) > np.cos(PEAK_ANGLE)).sum(axis=1).astype(np.float64)
    while len(found) < MAX_DIRECTIONS and votes.max() >= max(8.0, 0.01 * len(normals)):
        direction = candidates[int(votes.argmax())]
        for _ in range(3):
            aligned = normals @ direction
            near = np.abs(aligned) > np.cos(PEAK_ANGLE)
            mean = (normals[near] * np.sign(aligned[near])[:, None]).sum(axis=0)
            direction = mean / np.linalg.norm(mean)
        found.append(direction)
        votes[np.abs(candidates @ direction) > np.cos(APART_ANGLE)] = 0.0
    return found


def _prior(direction: np.ndarray) -> float:
    return max(
        (PRIOR[name] for name, axis in UP_AXES.items() if float(np.array(axis) @ direction) > np.cos(AXIS_ANGLE)),
        default=-0.2,
    )


def _evidence(points: np.ndarray, normals: np.ndarray, planarity: np.ndarray, up: np.ndarray) -> float:
    """Weigh a direction: a room wider than high, a floor at its end, upright surfaces, level ones in the lower half."""
    height = points @ up
    low, high = np.quantile(height, [0.005, 0.995])
    level = (height - low) / max(float(high - low), 1e-12)
    flat = planarity > 0.4
    aligned = np.abs(normals @ up)
    horizontal, vertical = flat & (aligned > 0.97), flat & (aligned < 0.12)
    total = max(int(flat.sum()), 1)
    floor, ceiling = (float((horizontal & part).sum()) / total for part in (level < 0.06, level > 0.94))
    plan = points - height[:, None] * up
    width = float(np.linalg.norm(plan - plan.mean(axis=0), axis=1).mean()) * 2.6
    flatness = float(np.clip(np.log(max(width, 1e-12) / max(float(high - low), 1e-12)), -1.0, 1.0))
    # A floor counts up to what is plausible; a wall at the end of a long room is as large.
    return (
        3.0 * min(floor, 0.25)
        + 0.5 * min(ceiling, 0.25)
        + LOW_WEIGHT * _lowness(points, level, up)
        + WIDE_WEIGHT * flatness
        + 1.0 * float((horizontal | vertical).sum()) / total
        + 0.3 * float(vertical.sum()) / total
    )


def _lowness(points: np.ndarray, level: np.ndarray, up: np.ndarray) -> float:
    """Compare how much stands in the lower and in the upper half of a room beside its walls, in [-1, 1]."""
    east = np.cross(up, np.eye(3)[np.abs(up).argmin()])
    plan = np.column_stack([points @ east, points @ np.cross(up, east)]) / np.linalg.norm(east)
    column = np.floor((plan - plan.min(axis=0)) / (np.ptp(plan, axis=0).max() / 40 + 1e-12)).astype(np.int64)
    column_code = column[:, 0] * 64 + column[:, 1]
    step = np.clip((level * 12).astype(np.int64), 0, 11)
    filled = np.unique(column_code * 12 + step) // 12
    codes, counts = np.unique(filled, return_counts=True)
    tall = np.isin(column_code, codes[counts > TALL * 12])
    inside = ~tall & (level > 0.06) & (level < 0.94)
    if not inside.any():
        return 0.0
    low, high = (float((inside & half).sum()) for half in (level < 0.5, level >= 0.5))
    return (low - high) / (low + high)
