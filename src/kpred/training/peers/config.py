"""Settings of the peers' trainings; what was published is the default where it was."""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass, field
from typing import Any, Literal

from kpred.errors import ConfigError
from kpred.training.config import StageConfig


@dataclass(frozen=True)
class PeerTraining:
    """What the trainings of all peers share.

    Attributes:
        optimisation: steps, batch (targets a step), rate.
        points: points of each cloud in a step.
        stretch: targets are scaled per axis by up to this factor and put back into their unit boxes (1 is off).
        seed, checkpoint_every, precision, compile: as in `kpred.training.config.TrainConfig`.
    """

    optimisation: StageConfig = field(default_factory=lambda: StageConfig(steps=10_000, batch=16))
    points: int = 1024
    stretch: float = 1.0
    seed: int = 0
    checkpoint_every: int = 200
    precision: Literal["float32", "bfloat16"] = "float32"
    compile: bool = False

    def __post_init__(self) -> None:
        if self.points < 64:
            raise ConfigError(f"Training needs at least 64 points a cloud, but points = {self.points}.")

    def to_dict(self) -> dict[str, Any]:
        """Plain values for checkpoints and records."""
        return dataclasses.asdict(self)


@dataclass(frozen=True)
class KeypointDeformerTraining(PeerTraining):
    """Losses of KeypointDeformer.

    Attributes:
        warmup: first steps with the keypoint loss alone.
        keypoint_weight: of the Chamfer distance between keypoints and farthest-point samples.
        spread_samples: farthest-point samples, twice the keypoints.
        offset_weight: of the mean square of the influence's offset. The published code has 10^6, which in a short
            training leaves no offset at all.
    """

    warmup: int = 200
    keypoint_weight: float = 2.0
    spread_samples: int = 24
    offset_weight: float = 0.1


@dataclass(frozen=True)
class Uy2021Training(PeerTraining):
    """Losses of Uy et al. 2021.

    Attributes:
        candidates: sources deformed to each target of a batch (10).
        warmup: first steps in which candidates are drawn at random; after them half of them are drawn by the
            retrieval's own odds, so that the deformation learns what is retrieved.
        retrieval_weight: of the difference between the odds of the retrieval and those of the deformation errors.
        temperature: odds of sources fall by e for each such share of the mean error by which they are worse.
    """

    optimisation: StageConfig = field(default_factory=lambda: StageConfig(steps=10_000, batch=8))
    candidates: int = 6
    warmup: int = 500
    retrieval_weight: float = 0.1
    temperature: float = 0.2

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.candidates < 2:
            raise ConfigError(f"Retrieval is learned from at least 2 candidates, but candidates = {self.candidates}.")
