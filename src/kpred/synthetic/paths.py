"""Center lines of bent tubes and curved rails."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from kpred.synthetic.part import Number, Vector


def rounded_path(corners: np.ndarray | Sequence[Vector], radius: Number, segments: int = 4) -> np.ndarray:
    """Open polyline (N, 3) through `corners` (K, 3) with each inner corner rounded by about `radius` metres."""
    points = [np.asarray(corner, dtype=np.float64) for corner in corners]
    path = [points[0]]
    for before, corner, after in zip(points[:-2], points[1:-1], points[2:], strict=True):
        back, forth = before - corner, after - corner
        reach = min(radius, 0.45 * float(np.linalg.norm(back)), 0.45 * float(np.linalg.norm(forth)))
        start = corner + back / np.linalg.norm(back) * reach
        end = corner + forth / np.linalg.norm(forth) * reach
        for t in np.linspace(0.0, 1.0, segments + 1):
            path.append((1 - t) ** 2 * start + 2 * t * (1 - t) * corner + t**2 * end)
    path.append(points[-1])
    return np.array(path)


def bezier(start: Vector, control: Vector, end: Vector, segments: int = 8) -> np.ndarray:
    """Return a quadratic Bezier curve as a polyline (segments + 1, 3)."""
    a, b, c = (np.asarray(point, dtype=np.float64) for point in (start, control, end))
    t = np.linspace(0.0, 1.0, segments + 1)[:, None]
    return (1 - t) ** 2 * a + 2 * t * (1 - t) * b + t**2 * c


def arc(
    center: Vector, radius_x: Number, radius_z: Number, first: Number, last: Number, segments: int = 12
) -> np.ndarray:
    """Return a horizontal elliptic arc (segments + 1, 3); angles in degrees from +x towards +z."""
    angles = np.radians(np.linspace(first, last, segments + 1))
    plan = np.column_stack([radius_x * np.cos(angles), np.zeros(segments + 1), radius_z * np.sin(angles)])
    return plan + np.asarray(center, dtype=np.float64)
