"""Which way is up: the axis along which a cloud looks most like furniture that stands on its feet."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from kpred.ops.rotations import UP_AXES
from kpred.ops.typing import Float
from kpred.preprocessing.floor_and_wall import floor_stub
from kpred.preprocessing.normals import estimate_normals, neighbour_normals
from kpred.preprocessing.outliers import neighbourhood

SAMPLE = 2048

PRIOR = {"y": 0.0, "z": 0.0, "-y": -2.0, "-z": -3.5, "x": -3.5, "-x": -3.5}
"""Files have y or z up and cameras -y; of the others only clear evidence convinces. Log-odds."""

FLOOR = 4.0
"""What a piece of floor that reaches beyond the object says for its axis. Log-odds."""

BEYOND_FLOOR = 10.0
"""Axes that are so much less likely than the best (log-odds) are not asked whether there is a floor. Of 1,260 axes of
depth scans of training shapes they were 38 %, and none of them was right.
"""

SURE = 4.0
"""Log-odds of the first axis against the second from which on the second is not worth trying."""

WEIGHTS = np.array([4.2, 7.72, 5.0, 4.19, -2.75, -0.66, 0.38, -6.95, 1.33, 1.37])
"""Of the evidence of `_evidence`: a logistic regression on depth scans of this package's synthetic furniture."""


def find_up(points: Float[np.ndarray, "points 3"]) -> list[str]:
    """The axes (x, y, z, -x, -y, -z) that may point up, the most plausible first: one if it is clear, else two.

    Furniture stands: its lowest points span an area that its middle lies over, on the floor if that was scanned too;
    its surfaces are level or upright, and those that carry are well above its feet.
    """
    scores = up_scores(points)
    order = sorted(scores, key=lambda name: -scores[name])
    return order[:1] if scores[order[0]] - scores[order[1]] > SURE else order[:2]


def up_scores(points: Float[np.ndarray, "points 3"]) -> dict[str, float]:
    """Log-odds of each axis (x, y, z, -x, -y, -z) for pointing up, up to a constant."""
    rows = np.linspace(0, len(points) - 1, min(len(points), SAMPLE)).astype(np.int64)
    sample = points[rows] - points[rows].mean(axis=0)
    distance = np.linalg.norm(sample, axis=1)
    sample = sample[distance <= np.quantile(distance, 0.99)]
    size = 2.0 * float(distance.max())
    if len(sample) < 64 or size <= 0:
        return dict(PRIOR)
    sample = sample / size
    near = neighbourhood(sample)
    some = np.arange(0, len(sample), max(1, len(sample) // 1024))
    normals = neighbour_normals(sample, np.column_stack([some, near.index[some]]))
    whole = _Surface(sample, sample[some], *normals)
    axes = {name: np.array(axis, dtype=np.float64) for name, axis in UP_AXES.items()}
    scores = {name: PRIOR[name] + float(_evidence(whole, up) @ WEIGHTS) for name, up in axes.items()}
    likely = [name for name in axes if scores[name] > max(scores.values()) - BEYOND_FLOOR]
    for name in likely:
        floor = floor_stub(sample, near.reach, axes[name], 1.0, least_beyond=0.15)
        if floor is None:
            continue
        scores[name] = PRIOR[name] + FLOOR
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
    """Ten numbers that tell standing furniture from furniture that lies or hangs, none depending on unit or yaw."""
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
