"""What trainings of a single stage share: the settings of the loop, and the stage's plain parts."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import Any, Generic, TypeVar

import torch
from torch import nn

from kpred.training.config import LoopConfig, StageConfig

Settings = TypeVar("Settings", bound="SingleStageConfig")


@dataclass(frozen=True)
class SingleStageConfig(LoopConfig):
    """Settings of a training that has one stage.

    Attributes:
        optimisation: steps, batch (targets a step), rate.
    """

    optimisation: StageConfig = field(default_factory=lambda: StageConfig(steps=10_000, batch=16))


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
