"""What trainings of a single stage share: the settings of the loop, and the stage's plain parts."""

from __future__ import annotations

import dataclasses
from abc import ABC, abstractmethod
from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import Any, Generic, Literal, TypeVar

import torch
from torch import nn

from kpred.errors import ConfigError
from kpred.training.config import StageConfig

Settings = TypeVar("Settings", bound="SingleStageConfig")


@dataclass(frozen=True)
class SingleStageConfig:
    """Settings of the loop.

    Attributes:
        optimisation: steps, batch (targets a step), rate.
        points: points of each cloud in a step.
        seed, checkpoint_every, precision, compile: as in `kpred.training.config.TrainConfig`.
    """

    optimisation: StageConfig = field(default_factory=lambda: StageConfig(steps=10_000, batch=16))
    points: int = 1024
    seed: int = 0
    checkpoint_every: int = 200
    precision: Literal["float32", "bfloat16"] = "float32"
    compile: bool = False

    def __post_init__(self) -> None:
        if self.points < 64:
            raise ConfigError(f"Training needs at least 64 points a cloud, but points = {self.points}.")

    def to_dict(self) -> dict[str, Any]:
        """Return plain values for checkpoints and records."""
        return dataclasses.asdict(self)


class SingleStage(ABC, Generic[Settings]):
    """A network's only stage, in the form that the training loop wants; what is left to write is `losses`.

    Attributes:
        name: of the stage and its checkpoint; config: all settings.
    """

    name: str
    config: Settings
    network: Any

    @property
    def settings(self) -> StageConfig:
        """The optimisation settings."""
        return self.config.optimisation

    def model_config(self) -> dict[str, Any]:
        """Return the network's config."""
        values: dict[str, Any] = self.network.config.to_dict()
        return values

    def parameters(self) -> Iterator[nn.Parameter]:
        """Return all parameters of the network."""
        found: Iterator[nn.Parameter] = self.network.parameters()
        return found

    def start(self) -> None:
        """Do nothing."""

    @abstractmethod
    def losses(self, step: int, generator: torch.Generator) -> dict[str, torch.Tensor]:
        """Compute the loss terms of one random batch."""
