"""PointNet without transforms: features of a cloud's points, and one of the whole cloud."""

from __future__ import annotations

import torch
from torch import nn
from torch.nn import functional

from kpred.ops.typing import Float

POINT_FEATURES = 256
"""Length of a point's own feature."""


class PointNet(nn.Module):
    """Shared layers 3-64-128-256, the maximum over the points, then two layers to the wanted size (leaky ReLU)."""

    def __init__(self, size: int) -> None:
        super().__init__()
        self.shared = nn.ModuleList([nn.Linear(3, 64), nn.Linear(64, 128), nn.Linear(128, POINT_FEATURES)])
        self.hidden, self.output = nn.Linear(POINT_FEATURES, 256), nn.Linear(256, size)

    def forward(self, points: Float[torch.Tensor, "batch points 3"]) -> Float[torch.Tensor, "batch size"]:
        """Encode each cloud (unit box), invariant to the order of its points."""
        return self.pooled(self.of_points(points))

    def of_points(self, points: Float[torch.Tensor, "batch points 3"]) -> Float[torch.Tensor, "batch points 256"]:
        """Encode each point by its own position."""
        features = points
        for layer in self.shared:
            features = functional.leaky_relu(layer(features), 0.1)
        return features

    def pooled(self, features: Float[torch.Tensor, "batch points 256"]) -> Float[torch.Tensor, "batch size"]:
        """Return pool the features of points to one feature of each cloud."""
        pooled = functional.leaky_relu(self.hidden(features.amax(1)), 0.1)
        feature: torch.Tensor = self.output(pooled)
        return feature
