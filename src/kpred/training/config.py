"""Settings of the three training stages (paper Sec. 4, implementation details; schedule of the published configs)."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Literal

from kpred.errors import ConfigError
from kpred.nn.plain_config import PlainConfig


@dataclass(frozen=True)
class StageConfig(PlainConfig):
    """One stage's optimisation.

    Attributes:
        steps: optimiser steps.
        batch: source/target pairs a step.
        learning_rate: Adam's base rate.
        schedule: `constant`, or `cosine` decay to 2 % of the base rate.
    """

    steps: int = 10_000
    batch: int = 16
    learning_rate: float = 1e-3
    schedule: Literal["constant", "cosine"] = "cosine"

    def __post_init__(self) -> None:
        if self.steps < 1 or self.batch < 2:
            raise ConfigError(f"A stage needs at least 1 step and a batch of 2, but has {self.steps} and {self.batch}.")
        if not self.learning_rate > 0:
            raise ConfigError(f"The learning rate must be positive, but is {self.learning_rate}.")


@dataclass(frozen=True)
class LoopConfig(PlainConfig):
    """Settings of every training loop.

    Attributes:
        points: points of each cloud in a step.
        seed: of everything random.
        checkpoint_every: steps between checkpoints.
        precision: `float32`, or `bfloat16` autocast of the networks (CUDA).
        compile: torch.compile the networks (CUDA).
    """

    points: int = 1024
    seed: int = 0
    checkpoint_every: int = 200
    precision: Literal["float32", "bfloat16"] = "float32"
    compile: bool = False

    def __post_init__(self) -> None:
        if self.points < 64:
            raise ConfigError(f"Training needs at least 64 points a cloud, but points = {self.points}.")


@dataclass(frozen=True)
class TrainConfig(LoopConfig):
    """All of a category's training.

    Attributes:
        deformation, retrieval, partial: the three stages, run in this order.
        keypoint_points: of the points of a cloud, how many the keypoint predictors see.
        warmup: first steps of the deformation stage with the keypoint loss alone; without them the tokens of all
            regions start out equal and the encoder's gradients explode.
        keypoint_weight, keypoint_weight_late, late_step: lambda_kpt before and after `late_step`.
        spread_samples: farthest-point samples that the keypoints are drawn to.
        source_choices: each target is given the nearest of so many random sources, since at test time sources are
            retrieved, not random (1 in the paper).
        refined_weight: weight of the Chamfer distance after keypoint refinement; it teaches the influence to span what
            refinement can use (0 in the paper).
        consistency_weight: of the difference between a deformed source's keypoints and their targets (0 in the paper).
        ranking_weight: of the difference between orders by token distance and by deformation error (0 in the paper).
        partial_keypoint_weight: lambda_wkpt.
        confidence_floor: least weight of a keypoint in the partial stage, however little of its region is seen (0.1 in
            the published code, which leaves unseen keypoints almost unsupervised).
        partial_token_weight: tokens of a partial cloud toward those of the full shape, weighted by confidence.
        whole_weight: weight, in the partial stage, of the distance from the whole target's surface to the result:
            what is not seen is known in training (0 in the paper).
        frame_jitter: standard deviation by which the partial stage's frames are off in place and (as a factor) in
            size, for half of its targets, as real scans' frames are inexact (0 in the paper).
        occlusion: least and greatest fraction of a target hidden in the partial stage.
        scanned: fraction of the partial stage's targets seen by a virtual depth camera rather than cut by a plane (0 in
            the paper).
        box_weight: weight of the whole object's box (0 in the paper, which takes the box as known).
        stretch: targets are scaled per axis by up to this factor and put back in their unit box (1 is off).
        noise: standard deviation of the jitter on partial clouds, unit-box units; each cloud gets up to this.
        outliers: fraction of stray points in partial clouds; each cloud gets up to this.
    """

    deformation: StageConfig = field(default_factory=StageConfig)
    retrieval: StageConfig = field(default_factory=lambda: StageConfig(learning_rate=1e-3, batch=32))
    partial: StageConfig = field(default_factory=StageConfig)
    keypoint_points: int = 512
    warmup: int = 200
    keypoint_weight: float = 2.0
    keypoint_weight_late: float = 0.1
    late_step: int = 1000
    spread_samples: int = 24
    source_choices: int = 4
    refined_weight: float = 1.0
    consistency_weight: float = 0.2
    ranking_weight: float = 0.05
    partial_keypoint_weight: float = 20.0
    confidence_floor: float = 0.5
    partial_token_weight: float = 1.0
    whole_weight: float = 2.0
    frame_jitter: float = 0.05
    occlusion: tuple[float, float] = (0.25, 0.9)
    scanned: float = 0.5
    box_weight: float = 0.5
    outliers: float = 0.01
    stretch: float = 1.3
    noise: float = 0.01

    def __post_init__(self) -> None:
        super().__post_init__()
        if not 0 <= self.occlusion[0] <= self.occlusion[1] < 1:
            raise ConfigError(f"Occlusion must be two fractions in [0, 1), low then high, but is {self.occlusion}.")


PAPER = TrainConfig(
    deformation=StageConfig(schedule="constant"),
    retrieval=StageConfig(learning_rate=1e-2, batch=16, schedule="constant"),
    partial=StageConfig(schedule="constant"),
    points=2048,
    keypoint_points=2048,
    source_choices=1,
    refined_weight=0.0,
    consistency_weight=0.0,
    ranking_weight=0.0,
    partial_token_weight=0.0,
    whole_weight=0.0,
    frame_jitter=0.0,
    confidence_floor=0.1,
    scanned=0.0,
    box_weight=0.0,
    outliers=0.0,
    stretch=1.0,
    noise=0.0,
)
"""The published losses and schedule, at the length of the released configs (10,000 steps a stage)."""
