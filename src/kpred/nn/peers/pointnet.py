"""PointNet without transforms: one feature of a whole cloud."""

from __future__ import annotations

import torch
from torch import nn
from torch.nn import functional

from kpred.ops.typing import Float


class PointNet(nn.Module):
    """Shared layers 3-64-128-256, the maximum over the points, then two layers to the wanted size (leaky ReLU)."""

    def __init__(self, size: int) -> None:
        super().__init__()
        self.shared = nn.ModuleList([nn.Linear(3, 64), nn.Linear(64, 128), nn.Linear(128, 256)])
        self.hidden, self.output = nn.Linear(256, 256), nn.Linear(256, size)

    def forward(self, points: Float[torch.Tensor, "batch points 3"]) -> Float[torch.Tensor, "batch size"]:
        """Feature of each cloud (unit box); the order of its points does not matter."""
        features = points
        for layer in self.shared:
            features = functional.leaky_relu(layer(features), 0.1)
        pooled = functional.leaky_relu(self.hidden(features.amax(1)), 0.1)
        feature: torch.Tensor = self.output(pooled)
        return feature
