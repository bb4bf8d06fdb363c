"""Points that no surface returned: exact repeats, the place that stands for "nothing seen", points very far away."""

from __future__ import annotations

import numpy as np

from kpred.ops.typing import Bool, Float
from kpred.preprocessing.config import MIN_POINTS
from kpred.preprocessing.outliers import duplicate_points

MIN_REPEATS = 16
MARKER_FRACTION = 0.01
"""A place that holds so many points, and this fraction of all, stands for rays without a hit: mostly 0, 0, 0."""

GAPS = ((0.05, 3.0), (0.25, 10.0))
"""Fractions of a scan that are left out if they lie beyond a gap, and by what factor the gap widens the scan."""


def invalid_points(points: Float[np.ndarray, "points 3"]) -> Bool[np.ndarray, " points"]:
    """Mark points that are left out before anything is measured; at least 64 are never marked.

    Of points at one place the first is kept, unless the place stands for rays without a hit. Far points are those
    behind a wide gap in distance from the scan's median: a single one would hide the object's size.
    """
    repeated = duplicate_points(points)
    found = repeated | _at_markers(points, repeated)
    rows = np.flatnonzero(~found)
    if len(rows) < MIN_POINTS:
        return repeated if np.count_nonzero(~repeated) >= MIN_POINTS else np.zeros(len(points), dtype=bool)
    far = _behind_gap(points[rows])
    if len(rows) - far.sum() >= MIN_POINTS:
        found[rows[far]] = True
    return found


def _at_markers(points: np.ndarray, repeated: np.ndarray) -> np.ndarray:
    """Return a mask (N,) of points at positions that hold a large part of all points."""
    found = np.zeros(len(points), dtype=bool)
    rows = np.flatnonzero(repeated)
    some = points[rows[:: max(1, len(rows) // 1024)]]
    places, counts = np.unique(some, axis=0, return_counts=True)
    for place in places[counts >= MIN_REPEATS]:
        there = (points == place).all(axis=1)
        if there.sum() > max(MIN_REPEATS, MARKER_FRACTION * len(points)):
            found |= there
    return found


def _behind_gap(points: np.ndarray) -> np.ndarray:
    """Return a mask (N,) of points farther from the median than a gap that no object has."""
    with np.errstate(over="ignore"):
        distance = np.linalg.norm(points - np.median(points, axis=0), axis=1)
    ordered = np.sort(distance)
    for fraction, factor in GAPS:
        outer = ordered[int((1.0 - fraction) * len(points)) :]
        wide = np.flatnonzero(outer[1:] > factor * np.maximum(outer[:-1], np.finfo(float).tiny))
        if len(wide) and outer[wide[0]] > 0:
            return np.asarray(distance > outer[wide[0]])
    return np.zeros(len(points), dtype=bool)
