"""The points that a fit starts with: read, checked, without those that no surface returned, in random order."""

from __future__ import annotations

import os
from dataclasses import dataclass

import numpy as np

from kpred.fitting.options import FitOptions
from kpred.ops.typing import Float
from kpred.preprocessing.clean import MANY_STRAYS, CleaningStep
from kpred.preprocessing.invalid_points import invalid_points
from kpred.preprocessing.outliers import neighbourhood, stray_points
from kpred.preprocessing.room import looks_like_room
from kpred.shapes.scan import check_points, read_scan
from kpred.shapes.unit import METRES

MAX_POINTS = 50_000
"""Points of a scan that are cleaned; of a denser scan so many are taken at random."""

SAMPLE = 2048
"""Points among which strays are looked for before the up axis is."""


@dataclass(frozen=True, eq=False)
class RawScan:
    """A scan as it was read.

    Attributes:
        points: (N, 3), N <= 50,000, scan's frame and unit, in random order; steps: what was left out before.
    """

    points: Float[np.ndarray, "points 3"]
    steps: tuple[CleaningStep, ...] = ()


def read_raw_scan(scan: str | os.PathLike[str] | np.ndarray, options: FitOptions) -> RawScan:
    """Read a scan; where it is to be cleaned, repeats, markers of missing points and far points are left out first.

    Raises:
        ScanError: the scan is missing, unreadable, degenerate or too small.
    """
    cloud, config = _checked(scan, options.seed), options.clean_config
    if config is None or not (config.duplicates and config.outliers):
        return RawScan(shuffled(cloud, options.seed))
    invalid = invalid_points(cloud)
    if not invalid.any():
        return RawScan(shuffled(cloud, options.seed))
    step = CleaningStep("invalid", int(invalid.sum()), "exact repeats, markers of missing points, points far away")
    return RawScan(shuffled(cloud[~invalid], options.seed), (step,))


def read_points(scan: str | os.PathLike[str] | np.ndarray, seed: int) -> np.ndarray:
    """Read at most `MAX_POINTS` points (N, 3) of a scan, in random order.

    Raises:
        ScanError: the scan is missing, unreadable, degenerate or too small.
    """
    return shuffled(_checked(scan, seed), seed)


def shuffled(points: Float[np.ndarray, "points 3"], seed: int) -> Float[np.ndarray, "few 3"]:
    """Take at most `MAX_POINTS` points in random order: the first of them are a fair sample too."""
    return points[np.random.default_rng(seed).permutation(len(points))[:MAX_POINTS]]


def is_room(scan: RawScan, up: str, options: FitOptions) -> bool:
    """Find out whether a scan is plainly a room and no object; in a known frame it is none."""
    if options.known:
        return False
    return looks_like_room(scan.points, up, None if options.unit == "auto" else METRES[options.unit])


def without_strays(points: Float[np.ndarray, "points 3"], ratio: float) -> Float[np.ndarray, "left 3"]:
    """Leave out strays of a scan in random order, if there are so many that they hide its shape.

    Args:
        ratio: how many times its neighbours' spacing a stray is away (`CleanConfig.outlier_ratio`).

    Returns:
        All points, or, where there are many strays, a sample without them.
    """
    few = points[:SAMPLE]
    if len(few) < 64:
        return points
    centred = few - np.median(few, axis=0)
    size = 2.0 * float(np.quantile(np.linalg.norm(centred, axis=1), 0.9))
    stray = stray_points(neighbourhood(centred), size, ratio)
    if stray.mean() <= MANY_STRAYS or np.count_nonzero(~stray) < 64:
        return points
    return few[~stray]


def _checked(scan: str | os.PathLike[str] | np.ndarray, seed: int) -> np.ndarray:
    name = "scan" if isinstance(scan, np.ndarray) else str(scan)
    cloud = scan if isinstance(scan, np.ndarray) else read_scan(scan, seed=seed)
    return check_points(np.asarray(cloud, dtype=np.float64), name)
