"""Settings of the recognizer's training."""

from __future__ import annotations

from dataclasses import dataclass, field

from kpred.errors import ConfigError
from kpred.training.config import StageConfig
from kpred.training.single_stage import SingleStageConfig


@dataclass(frozen=True)
class RecognitionConfig(SingleStageConfig):
    """Settings of the recognizer's training.

    Attributes:
        right, quarter, tilted: fractions of clouds that stand right, rotated by about 90, 180 or 270 degrees, and lying
            or upside down; the rest is rotated at random.
        others: fraction of things that are of no category.
        sliced, whole: fractions of clouds that are cut by a plane, or whole; the rest is seen by a depth camera.
        stretch: clouds are scaled per axis by up to this factor.
        noise, outliers: most jitter (unit box) and stray points (fraction) of a cloud.
        floor: fraction of clouds that stand on a piece of floor, of which cleaning may have left a part.
        rooms: fraction of clouds that are crops of scanned rooms, where room packs are given.
        room_others: fraction of the crops that are of no category.
        yaw_weight: of the error of the turn, in units of `MAX_YAW_CORRECTION`.
    """

    optimisation: StageConfig = field(default_factory=lambda: StageConfig(steps=5000, batch=48))
    points: int = 256
    right: float = 0.45
    quarter: float = 0.35
    tilted: float = 0.1
    others: float = 0.12
    sliced: float = 0.15
    whole: float = 0.15
    stretch: float = 1.2
    noise: float = 0.012
    outliers: float = 0.02
    floor: float = 0.1
    rooms: float = 0.5
    room_others: float = 0.25
    yaw_weight: float = 1.0

    def __post_init__(self) -> None:
        super().__post_init__()
        alone = ((fraction,) for fraction in (self.others, self.rooms, self.room_others))
        for fractions in ((self.right, self.quarter, self.tilted), (self.sliced, self.whole), *alone):
            if min(fractions) < 0 or sum(fractions) > 1:
                raise ConfigError(f"Fractions must not be negative or add up to more than 1, but are {fractions}.")
