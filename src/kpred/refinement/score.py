"""How well a result explains a scan, and what it had to change: the simplest explanation wins.

A result's squared distances hold three things: what the result gets wrong, the spacing of the samples that the
distances are measured between, and the noise of the scan. The second is estimated from the clouds themselves and taken
away; the third stays. The logarithm of what is left is compared, plus a cost for every step away from the model as it
is.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np

from kpred.ops.nearest_cpu import nearest_of_one
from kpred.ops.typing import Float
from kpred.refinement.score_cpu import mean_distances

Step = Literal["none", "scale", "structure", "free", "paper"]

COSTS: dict[Step, float] = {"none": 0.0, "scale": 0.08, "structure": 0.25, "free": 0.5, "paper": 0.0}
"""Fall of the log error that each step must bring beyond the undeformed model's (docs/deformation.md)."""

NOISE = 0.012
"""Least standard deviation of scans, unit box: 0.6 % of the longest side; below, errors are equal."""

FLOOR_DOUBT = 0.15
"""Fraction of the samples' own spacing that its estimate may be wrong by."""

STRAY = 0.2
"""Points farther than this from the other side are strays, or the other lacks them; how far says nothing; unit box."""

UNSEEN_WEIGHT = 0.3
"""Weight of what is unseen beside what is seen: where it is expected is a guess, above all where the box is one too."""

MIN_SEEN = 0.2
"""Fraction of a surface that must be seen for its distances to count in full."""


@dataclass(frozen=True)
class Distances:
    """Mean squared distances between a scan and a result, unit box.

    Attributes:
        forth: from the scan to the result; back: from the result's seen surface to the scan, weighted by visibility.
        bounded: both, with distances beyond `STRAY` counted as that.
        floor: what both would be for a perfect result, by the spacing of the samples.
        seen: mean visibility of the result's surface.
        unseen: mean squared distance of the result's unseen surface from where it is expected, by invisibility.
    """

    forth: float
    back: float
    bounded: float
    floor: float
    seen: float
    unseen: float = 0.0

    @property
    def error(self) -> float:
        """Both ways together: the Chamfer distance, of what is seen."""
        return self.forth + self.back

    def log_error(self) -> float:
        """Logarithm of the error beyond the samples' spacing, of what is seen and unseen, with the noise of scans."""
        noise = NOISE**2 + FLOOR_DOUBT * self.floor
        return float(np.log(max(self.bounded - self.floor, 0.0) + UNSEEN_WEIGHT * self.unseen + noise))


def spacing(points: Float[np.ndarray, "points 3"]) -> float:
    """Estimate the mean squared distance between two samples of the surface that points are a sample of."""
    if len(points) < 4:
        return 0.0
    squared, _ = nearest_of_one(np.ascontiguousarray(points[::2]), np.ascontiguousarray(points[1::2]))
    # Squared distances to the nearest sample are distributed exponentially; strays do not shift their median.
    return float(np.median(squared)) / np.log(2) / 2


def distances(
    goal: Float[np.ndarray, "goal 3"],
    spacings: tuple[float, float],
    result: Float[np.ndarray, "points 3"],
    visible: Float[np.ndarray, " points"],
    step: int = 1,
) -> Distances:
    """Measure the distances between a scan and a result, both float32, unit box.

    Args:
        spacings: of the scan and of the result (`spacing`); visible: how surely each point of the result was seen.
        step: every `step`-th point of each cloud is a query, searched among all points of the other.
    """
    means = mean_distances(np.ascontiguousarray(goal), np.ascontiguousarray(result), visible, step, STRAY**2)
    forth, forth_bounded, back, back_bounded, seen = means
    total = max(seen, MIN_SEEN)
    floor = spacings[1] + spacings[0] * min(1.0, seen / MIN_SEEN)
    return Distances(forth, back / total, forth_bounded + back_bounded / total, floor, seen)
