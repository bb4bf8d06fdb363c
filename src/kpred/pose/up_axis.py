"""Up axis of a scan, by geometric evidence for furniture that stands on its feet."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from kpred.ops.rotations import UP_AXES
from kpred.ops.typing import Float
from kpred.preprocessing.floor_and_wall import detect_floor
from kpred.preprocessing.normals import estimate_normals, neighbour_normals
from kpred.preprocessing.outliers import neighbourhood

SAMPLE = 2048

PRIOR = {"y": 0.0, "z": 0.0, "-y": -2.0, "-z": -3.5, "x": -3.5, "-x": -3.5}
"""Prior log-odds: files have y or z up, cameras -y; other axes need clear evidence."""

FLOOR_LOG_ODDS = 4.0
"""Log-odds that a piece of floor beyond the object adds for its axis."""

MAX_FLOOR_DEFICIT = 10.0
"""Axes whose log-odds are this much below the best are not searched for a floor."""

CLEAR_LOG_ODDS = 4.0
"""With at least this log-odds against the second axis, only the first is returned."""

WEIGHTS = np.array([4.2, 7.72, 5.0, 4.19, -2.75, -0.66, 0.38, -6.95, 1.33, 1.37])
"""Weights of `_evidence`: a logistic regression on depth scans of the synthetic furniture."""


def find_up(points: Float[np.ndarray, "points 3"]) -> list[str]:
    """Return the likeliest up axes (x, y, z, -x, -y, -z): one if it is clear, else two.

    Furniture stands: its lowest points span an area below its middle, on the floor if that was scanned too; its
    surfaces are horizontal or vertical, and load-bearing ones lie well above its feet.
    """
    scores = up_scores(points)
    order = sorted(scores, key=lambda name: -scores[name])
    return order[:1] if scores[order[0]] - scores[order[1]] > CLEAR_LOG_ODDS else order[:2]


def up_scores(points: Float[np.ndarray, "points 3"], names: Iterable[str] = UP_AXES) -> dict[str, float]:
    """Return the log-odds of each of these axes (x, y, z, -x, -y, -z) for pointing up, up to a constant."""
    rows = np.linspace(0, len(points) - 1, min(len(points), SAMPLE)).astype(np.int64)
    sample = points[rows] - points[rows].mean(axis=0)
    distance = np.linalg.norm(sample, axis=1)
    sample = sample[distance <= np.quantile(distance, 0.99)]
    size = 2.0 * float(distance.max())
    if len(sample) < 64 or size <= 0:
        return {name: PRIOR[name] for name in names}
    sample = sample / size
    near = neighbourhood(sample)
    some = np.arange(0, len(sample), max(1, len(sample) // 1024))
    normals = neighbour_normals(sample, np.column_stack([some, near.index[some]]))
    whole = _Surface(sample, sample[some], *normals)
    axes = {name: np.array(UP_AXES[name], dtype=np.float64) for name in names}
    scores = {name: PRIOR[name] + float(_evidence(whole, up) @ WEIGHTS) for name, up in axes.items()}
    likely = [name for name in axes if scores[name] > max(scores.values()) - MAX_FLOOR_DEFICIT]
    for name in likely:
        floor = detect_floor(sample, near.reach, axes[name], 1.0, min_beyond=0.15)
        if floor is None:
            continue
        scores[name] = PRIOR[name] + FLOOR_LOG_ODDS
        if np.count_nonzero(~floor.points) >= 64:
            scores[name] += float(_evidence(_surface(sample[~floor.points]), axes[name]) @ WEIGHTS)
    return scores


@dataclass(frozen=True, eq=False)
class _Surface:
    """Points (N, 3), some of them (S, 3), their normals (S, 3), and how planar it is around them (S,)."""

    points: np.ndarray
    sampled: np.ndarray
    normals: np.ndarray
    planarity: np.ndarray


def _surface(points: np.ndarray) -> _Surface:
    sampled = points[:: max(1, len(points) // 1024)]
    return _Surface(points, sampled, *estimate_normals(points, sampled, 10))


def _evidence(surface: _Surface, up: np.ndarray) -> np.ndarray:
    """Compute ten features that separate standing furniture from lying or hanging; independent of unit and yaw."""
    points, sampled = surface.points, surface.sampled
    normals, planarity = surface.normals, surface.planarity
    height = points @ up
    low, high = np.quantile(height, [0.005, 0.995])
    extent = max(float(high - low), 1e-9)
    level, sampled_level = (height - low) / extent, (sampled @ up - low) / extent
    flat = planarity > 0.3
    horizontal = flat & (np.abs(normals @ up) > 0.95)
    vertical = flat & (np.abs(normals @ up) < 0.1)
    plane = points - height[:, None] * up
    spread = max(float(np.linalg.norm(plane - plane.mean(axis=0), axis=1).mean()), 1e-9)
    feet, top = plane[level <= 0.06], level >= 0.94
    middle = feet.mean(axis=0)
    flats = max(int(flat.sum()), 1)
    return np.array(
        [
            (horizontal & (sampled_level > 0.25)).sum() / flats,
            horizontal.sum() / flats,
            vertical.sum() / flats,
            min(float(np.linalg.norm(feet - middle, axis=1).mean()) / spread, 1.5),
            min(float(np.linalg.norm(middle - plane.mean(axis=0))) / spread, 2.0),
            min(len(feet) / len(points) / 0.06, 3.0),
            min(float(top.mean()) / 0.06, 3.0),
            (horizontal & (sampled_level < 0.05)).sum() / flats,
            float(level.mean()),
            np.log(extent / spread),
        ]
    )
