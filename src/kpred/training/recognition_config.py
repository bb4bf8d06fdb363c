"""Settings of the recognizer's training."""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass, field
from typing import Any, Literal

from kpred.errors import ConfigError
from kpred.training.config import StageConfig


@dataclass(frozen=True)
class RecognitionConfig:
    """Settings of the recognizer's training.

    Attributes:
        optimisation: steps, batch, rate.
        points: points of each cloud.
        right, quarter, tilted: shares of clouds that stand right, turned by about 90, 180 or 270 degrees, and lying or
            upside down; the rest is turned at random.
        others: share of things that are of no category.
        sliced, whole: shares of clouds that are cut by a plane, or whole; the rest is seen by a depth camera.
        stretch: clouds are scaled per axis by up to this factor.
        noise, outliers: most jitter (unit box) and stray points (share) of a cloud.
        floor: share of clouds that stand on a piece of floor, of which cleaning may have left a part.
        turn_weight: of the error of the turn, in units of `MOST_TURN`; whole_weight: of the answer whether all is seen.
        seed, checkpoint_every, precision, compile: as in `TrainConfig`.
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
    turn_weight: float = 1.0
    whole_weight: float = 0.3
    seed: int = 0
    checkpoint_every: int = 200
    precision: Literal["float32", "bfloat16"] = "float32"
    compile: bool = False

    def __post_init__(self) -> None:
        if self.points < 64:
            raise ConfigError(f"Recognition needs at least 64 points a cloud, but points = {self.points}.")
        for shares in ((self.right, self.quarter, self.tilted), (self.sliced, self.whole), (self.others,)):
            if min(shares) < 0 or sum(shares) > 1:
                raise ConfigError(f"Shares must not be negative or add up to more than 1, but are {shares}.")

    def to_dict(self) -> dict[str, Any]:
        """Plain values for checkpoints and records."""
        return dataclasses.asdict(self)
