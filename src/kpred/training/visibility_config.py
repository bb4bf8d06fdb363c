"""Settings of the visibility network's training."""

from __future__ import annotations

from dataclasses import dataclass, field

from kpred.errors import ConfigError
from kpred.training.config import StageConfig
from kpred.training.single_stage import SingleStageConfig


@dataclass(frozen=True)
class VisibilityTraining(SingleStageConfig):
    """Settings of the visibility network's training.

    Attributes:
        points, min_points: most and fewest points of a scan in a step.
        queries: places around each scan in a step; a third on the surface, a third on another shape's, a third in the
            box.
        whole, sliced, viewed: fractions of scans that are whole, cut by a plane, or one depth view; the rest is merged
            of several views.
        max_views: most views that are merged.
        hidden: least and greatest fraction of a cloud that a plane cuts away.
        tolerance: places up to this distance (unit box) behind seen surface are seen.
        stretch: clouds are scaled per axis by up to this factor.
        density: greatest amplitude of the waves (logarithm of the density) that make the sampling uneven.
        noise, outliers: greatest jitter (unit box) and fraction of stray points of a scan.
        misplaced: greatest jitter (unit box) of places on surfaces.
        rooms: fraction of scans that are crops of scanned rooms, where room packs are given.
        rotated: fraction of scans at any yaw; the others are rotated by up to 10 degrees.
    """

    optimisation: StageConfig = field(default_factory=lambda: StageConfig(steps=10_000, batch=24, learning_rate=2e-3))
    points: int = 512
    min_points: int = 200
    queries: int = 240
    whole: float = 0.3
    sliced: float = 0.25
    viewed: float = 0.3
    max_views: int = 12
    hidden: tuple[float, float] = (0.1, 0.9)
    tolerance: float = 0.06
    stretch: float = 1.25
    density: float = 1.0
    noise: float = 0.012
    outliers: float = 0.02
    misplaced: float = 0.05
    rotated: float = 0.25
    rooms: float = 0.5

    def __post_init__(self) -> None:
        super().__post_init__()
        kinds = (self.whole, self.sliced, self.viewed)
        if min(kinds) < 0 or sum(kinds) > 1:
            raise ConfigError(f"Fractions must not be negative or add up to more than 1, but are {kinds}.")
        if not 0 <= self.rooms < 1:
            raise ConfigError(f"The fraction of crops of rooms must lie in [0, 1), but is {self.rooms}.")
        if not 64 <= self.min_points <= self.points:
            raise ConfigError(
                f"Scans need from 64 to `points` = {self.points} points, but min_points = {self.min_points}."
            )
        if self.max_views < 2 or self.queries < 3:
            raise ConfigError(
                f"Training needs 2 views or more and 3 queries or more, but has {self.max_views} and {self.queries}."
            )
        if not 0 <= self.hidden[0] <= self.hidden[1] < 1:
            raise ConfigError(f"Hidden fractions must rise from 0 to less than 1, but are {self.hidden}.")
