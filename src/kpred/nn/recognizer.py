"""Recognizer: category of a scan, and whether it faces +z upright, for one yaw at a time."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any

import torch
from torch import Tensor, nn
from torch.nn import functional

from kpred.errors import ConfigError
from kpred.nn.context import ContextBlock
from kpred.nn.plain_config import PlainConfig
from kpred.ops.typing import Float

MAX_YAW_CORRECTION = 0.5
"""Largest correction of a turn that the network gives, radians."""


@dataclass(frozen=True)
class RecognizerConfig(PlainConfig):
    """Architecture of a recognizer.

    Attributes:
        categories: names, in the order of the network's answers; "none of them" comes last.
        width: channels of the point features.
        blocks: context blocks.
    """

    categories: tuple[str, ...] = ()
    width: int = 128
    blocks: int = 3

    def __post_init__(self) -> None:
        if self.width < 1 or self.blocks < 0:
            raise ConfigError(
                f"A recognizer needs a positive width and no negative number of blocks, but has {self.width} and "
                f"{self.blocks}."
            )

    def to_dict(self) -> dict[str, Any]:
        """Return plain values for config.json and checkpoints."""
        return {**super().to_dict(), "categories": list(self.categories)}


class Recognizer(nn.Module):
    """PointNet with context blocks over a cloud, maybe partial, in any unit, y up, rotated by a supposed yaw.

    It answers two questions about the cloud as it stands: which category it is of, or none (another thing, or not
    facing +z, or not upright); and the small yaw after which it faces +z exactly. Several calls find the yaw.

    Attributes:
        second: another recognizer of the same categories, trained independently, for `predict_ensemble`.
    """

    def __init__(self, config: RecognizerConfig) -> None:
        super().__init__()
        self.config = config
        width = config.width
        self.local = nn.ModuleList([nn.Linear(3, 64), nn.Linear(64, width)])
        self.context = nn.ModuleList([ContextBlock(width) for _ in range(config.blocks)])
        self.wide = nn.Linear(width, 2 * width)
        self.shape = nn.ModuleList([nn.Linear(4 * width, 2 * width), nn.Linear(2 * width, width)])
        self.output = nn.Linear(width, len(config.categories) + 2)
        self.second: Recognizer | None = None

    def knows(self, categories: Iterable[str]) -> bool:
        """Check whether it was trained on all of the categories."""
        return set(categories) <= set(self.config.categories)

    def forward(
        self, points: Float[Tensor, "batch points 3"]
    ) -> tuple[Float[Tensor, "batch answers"], Float[Tensor, " batch"]]:
        """Predict logits of the categories and, last, of "none"; and the missing yaw about +y (radians)."""
        features = robust_unit_box(points)
        for layer in self.local:
            features = functional.leaky_relu(layer(features), 0.1, inplace=True)
        for block in self.context:
            features = block(features)
        features = functional.leaky_relu(self.wide(features), 0.1, inplace=True)
        shape = torch.cat([features.amax(1), features.mean(1)], dim=1)
        for layer in self.shape:
            shape = functional.leaky_relu(layer(shape), 0.1)
        answers = self.output(shape)
        return answers[:, :-1], MAX_YAW_CORRECTION * torch.tanh(answers[:, -1])

    def predict_ensemble(
        self, points: Float[Tensor, "batch points 3"]
    ) -> tuple[Float[Tensor, "batch answers"], Float[Tensor, " batch"]]:
        """Predict as `forward`, averaged with the second recognizer if there is one: log-probabilities and yaw."""
        logits, yaw = self(points)
        if self.second is None:
            return logits, yaw
        other_logits, other_yaw = self.second(points)
        return (logits.log_softmax(1) + other_logits.log_softmax(1)) / 2, (yaw + other_yaw) / 2


def robust_unit_box(points: Float[Tensor, "batch points 3"]) -> Float[Tensor, "batch points 3"]:
    """Scale clouds so that their middle 96 % along each axis fill [-1, 1] along the longest."""
    ordered = points.sort(dim=1).values
    cut = points.shape[1] // 50
    low, high = ordered[:, cut], ordered[:, points.shape[1] - 1 - cut]
    half = ((high - low).amax(1) / 2).clamp(min=torch.finfo(points.dtype).tiny)
    return (points - ((low + high) / 2)[:, None]) / half[:, None, None]
