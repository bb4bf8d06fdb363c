"""Propose the yaws (radians about y) of furniture that stands upright, from its points alone."""

from __future__ import annotations

from typing import no_type_check

import numba
import numpy as np
from scipy.spatial import ConvexHull, QhullError

from kpred.ops.typing import Float
from kpred.preprocessing.normals import estimate_normals

QUARTER = np.pi / 2
MERGE_ANGLE = np.radians(3.0)
"""Yaws closer than this (radians) are merged; keypoints and refinement correct the rest."""

SAMPLE = 2048


def yaw_hypotheses(points: Float[np.ndarray, "points 3"], max_yaws: int = 8) -> list[float]:
    """Propose yaws about +y (radians, in (-pi, pi]) that align furniture with the axes, the most plausible first.

    Furniture has straight sides, so yaws come in fours. Directions are proposed by the tightest rectangle around the
    footprint, by the normals of vertical surfaces, and by the direction in which the footprint falls into the
    sharpest lines; proposals within three degrees are merged. The first four yaws are those of the likeliest
    direction. The identity comes last, if there is room for it.

    Args:
        points: y up, any unit.
    """
    rows = np.linspace(0, len(points) - 1, min(len(points), SAMPLE)).astype(np.int64)
    sample = points[rows]
    footprint = sample[:, [0, 2]]
    footprint = footprint - np.median(footprint, axis=0)
    reach = np.abs(footprint).max(axis=1)
    core = footprint[reach <= np.quantile(reach, 0.995)]
    core = core / max(float(np.abs(core).max()), np.finfo(float).tiny)
    normals, planarity = estimate_normals(sample, sample[:: max(1, len(sample) // 1024)], 10)
    direction, weight = _wall_angles(normals, planarity)
    sharp = _sharpness(core)
    proposals = [rectangle_yaw(core), *_wall_peaks(direction, weight), sharp.argmax() * QUARTER / len(sharp)]
    merged: list[list[float]] = []
    for angle in proposals:
        for group in merged:
            if abs(_quarter_difference(angle, group[0])) < MERGE_ANGLE:
                group.append(angle)
                break
        else:
            merged.append([angle])
    scored = []
    for group in merged:
        offset = _quarter_difference(direction, group[0])
        close = np.abs(offset) < np.radians(5)
        aligned = float(weight[close].sum()) / max(float(weight.sum()), 1e-9)
        position = group[0] / QUARTER * len(sharp)
        score = float(sharp[int(round(position)) % len(sharp)] / sharp.max())
        score += aligned * min(1.0, float(weight.sum()) / 100.0) + 0.15 * (len(group) - 1)
        # Many normals give the direction more precisely than two corners of the outline.
        exact = group[0] + float(np.average(offset[close], weights=weight[close])) if close.sum() >= 50 else group[0]
        scored.append((score, exact))
    scored.sort(key=lambda entry: -entry[0])
    yaws: list[float] = []
    for _, angle in scored[: max(1, max_yaws // 4)]:
        yaws += _ordered_quarters(sample, angle)
    if len(yaws) < max_yaws and all(abs(_difference(yaw, 0.0)) > MERGE_ANGLE for yaw in yaws):
        yaws.append(0.0)
    return yaws[:max_yaws]


def rectangle_yaw(footprint: Float[np.ndarray, "points 2"]) -> float:
    """Return the yaw in [0, pi/2) that aligns the tightest rectangle around an (x, z) footprint with the axes."""
    try:
        corners = footprint[ConvexHull(footprint).vertices]
    except (QhullError, ValueError):
        return 0.0
    edges = np.roll(corners, -1, axis=0) - corners
    angles = np.unique(np.arctan2(edges[:, 1], edges[:, 0]) % QUARTER)
    c, s = np.cos(angles), np.sin(angles)
    along = corners @ np.stack([c, s])
    across = corners @ np.stack([-s, c])
    area = np.ptp(along, axis=0) * np.ptp(across, axis=0)
    return float(angles[area.argmin()])


def _wall_angles(normals: np.ndarray, planarity: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return angles modulo a quarter turn, and weights, of the normals of vertical surfaces."""
    vertical = (np.abs(normals[:, 1]) < 0.25) & (planarity > 0.2)
    chosen = normals[vertical]
    return np.arctan2(chosen[:, 2], chosen[:, 0]) % QUARTER, planarity[vertical] ** 2


def _wall_peaks(angle: np.ndarray, weight: np.ndarray, max_peaks: int = 2) -> list[float]:
    bins = 90
    if len(angle) < 12:
        return []
    histogram = np.bincount((angle / QUARTER * bins).astype(np.int64) % bins, weight, bins)
    smooth = sum(np.roll(histogram, shift) * factor for shift, factor in ((-2, 0.5), (-1, 1), (0, 1), (1, 1), (2, 0.5)))
    smooth = np.asarray(smooth)
    peaks: list[float] = []
    for _ in range(max_peaks):
        peak = int(smooth.argmax())
        if smooth[peak] < 0.1 * weight.sum():
            break
        middle = (peak + 0.5) * QUARTER / bins
        offset = _quarter_difference(angle, middle)
        close = np.abs(offset) < np.radians(4)
        peaks.append(float((middle + np.average(offset[close], weights=weight[close])) % QUARTER))
        smooth[(peak + np.arange(-6, 7)) % bins] = 0.0
    return peaks


def _sharpness(footprint: np.ndarray, bins: int = 64) -> np.ndarray:
    """Measure, for each degree of a quarter turn, how unevenly the footprint spreads over its two axes."""
    angles = np.arange(90) * QUARTER / 90
    counts = np.zeros((2, 90, 2 * bins))
    _spread(np.ascontiguousarray(footprint), np.cos(angles), np.sin(angles), counts)
    smooth = counts[..., 1:] + counts[..., :-1]
    sharp: np.ndarray = (smooth**2).sum(axis=(0, 2)) / max(len(footprint), 1) ** 2
    return sharp


@numba.njit(cache=True, nogil=True)
@no_type_check
def _spread(footprint, c, s, counts):
    """Count points of the rotated footprint in bins between -1.5 and 1.5 along its two axes."""
    bins = counts.shape[2]
    for yaw in range(len(c)):
        for i in range(len(footprint)):
            x, z = footprint[i, 0], footprint[i, 1]
            across, along = x * c[yaw] + z * s[yaw], z * c[yaw] - x * s[yaw]
            counts[0, yaw, min(max(int((across + 1.5) / 3.0 * bins), 0), bins - 1)] += 1.0
            counts[1, yaw, min(max(int((along + 1.5) / 3.0 * bins), 0), bins - 1)] += 1.0


def _ordered_quarters(points: np.ndarray, angle: float) -> list[float]:
    """Order the four yaws of one direction: long side across and high part at the back (-z) first."""
    x, z = points[:, 0], points[:, 2]
    height = points[:, 1]
    high = height >= np.quantile(height, 0.8)
    entries = []
    for quarter in range(4):
        yaw = (angle + quarter * QUARTER + np.pi) % (2 * np.pi) - np.pi
        across = x * np.cos(yaw) + z * np.sin(yaw)
        along = z * np.cos(yaw) - x * np.sin(yaw)
        width, depth = (float(np.ptp(np.quantile(value, [0.01, 0.99]))) for value in (across, along))
        middle = float(np.quantile(along, [0.01, 0.99]).mean())
        behind = (middle - float(along[high].mean())) / max(depth, 1e-12)
        entries.append((-(2.0 * behind + np.log(max(width, 1e-12) / max(depth, 1e-12))), float(yaw)))
    return [yaw for _, yaw in sorted(entries)]


def _quarter_difference(angle: np.ndarray | float, other: float) -> np.ndarray:
    return np.asarray((np.asarray(angle) - other + QUARTER / 2) % QUARTER - QUARTER / 2)


def _difference(angle: float, other: float) -> float:
    return float((angle - other + np.pi) % (2 * np.pi) - np.pi)
