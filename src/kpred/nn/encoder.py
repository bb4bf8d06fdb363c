"""Region encoder: local feature aggregation in keypoint balls and geometric self-attention between them.

Paper Sec. 3.1 "Geometric Self-Attention" and Fig. 2 (R-D to R-F, D-D to D-F).
"""

from __future__ import annotations

import torch
from torch import Tensor, nn
from torch.nn import functional

from kpred.nn.config import ModelConfig
from kpred.ops.regions import ball_query, gather_points
from kpred.ops.typing import Float


class TokenAttention(nn.Module):
    """One pre-norm transformer block over a shape's region tokens."""

    def __init__(self, width: int, heads: int) -> None:
        super().__init__()
        self.heads = heads
        self.before, self.after = nn.LayerNorm(width), nn.LayerNorm(width)
        self.project, self.merge = nn.Linear(width, 3 * width), nn.Linear(width, width)
        self.widen, self.narrow = nn.Linear(width, 2 * width), nn.Linear(2 * width, width)

    def forward(self, tokens: Float[Tensor, "batch regions width"]) -> Float[Tensor, "batch regions width"]:
        """Transform tokens by attention among them, in the same order."""
        query, key, value = self.project(self.before(tokens)).unflatten(2, (3, self.heads, -1)).unbind(2)
        attended = functional.scaled_dot_product_attention(
            query.transpose(1, 2), key.transpose(1, 2), value.transpose(1, 2)
        )
        tokens = tokens + self.merge(attended.transpose(1, 2).flatten(2))
        return tokens + self.narrow(functional.leaky_relu(self.widen(self.after(tokens)), 0.1))


class RegionEncoder(nn.Module):
    """Points and keypoints -> one token a keypoint, from the ball around it and from its relations to the others."""

    def __init__(self, config: ModelConfig) -> None:
        super().__init__()
        self.config = config
        width = config.width
        self.first = nn.ModuleList([nn.Linear(6, 64), nn.Linear(64, width)])
        self.later_points = nn.ModuleList([nn.Linear(width, width) for _ in range(config.stages - 1)])
        self.later_tokens = nn.ModuleList([nn.Linear(width, width, bias=False) for _ in range(config.stages - 1)])
        self.place = nn.Linear(3, width)
        self.identity = _identity(config)
        self.attention = nn.ModuleList([TokenAttention(width, config.heads) for _ in range(config.stages)])
        self.final = nn.LayerNorm(width)

    def forward(
        self, points: Float[Tensor, "batch points 3"], keypoints: Float[Tensor, "batch keypoints 3"]
    ) -> Float[Tensor, "batch keypoints width"]:
        """Encode regions as tokens; both inputs in one unit-box frame."""
        index, _ = ball_query(points.detach(), keypoints.detach(), self.config.radius, self.config.region_points)
        region = gather_points(points, index)
        relative = (region - keypoints[:, :, None]) / self.config.radius
        features = torch.cat([relative, region], dim=-1)
        for layer in self.first:
            features = functional.leaky_relu(layer(features), 0.1, inplace=True)
        tokens = features.amax(2) + self.place(keypoints) + self.identity
        tokens = self.attention[0](tokens)
        for to_points, to_tokens, attend in zip(self.later_points, self.later_tokens, self.attention[1:], strict=True):
            mixed = to_points(features).add_(to_tokens(tokens)[:, :, None])
            features = functional.leaky_relu(mixed, 0.1, inplace=True)
            tokens = attend(tokens + features.amax(2))
        return self.final(tokens)


class GlobalEncoder(nn.Module):
    """One PointNet feature for all keypoints: what stands in for `RegionEncoder` where GSA or LGF is ablated."""

    def __init__(self, config: ModelConfig) -> None:
        super().__init__()
        self.config = config
        self.layers = nn.ModuleList([nn.Linear(3, 64), nn.Linear(64, 128), nn.Linear(128, config.width)])
        self.identity = _identity(config)

    def forward(
        self, points: Float[Tensor, "batch points 3"], keypoints: Float[Tensor, "batch keypoints 3"]
    ) -> Float[Tensor, "batch keypoints width"]:
        """Encode the shape once per keypoint; tokens differ by the keypoint's identity only."""
        features = points
        for layer in self.layers:
            features = functional.leaky_relu(layer(features), 0.1)
        return features.amax(1)[:, None] + self.identity


def _identity(config: ModelConfig) -> nn.Parameter:
    """Draw the features (keypoints, width) that distinguish keypoints before training."""
    features = torch.empty(config.keypoints, config.width)
    # On the meta device only sizes are wanted, and drawing there would load torch's compiler: longer than a fit.
    if not features.is_meta:
        features.normal_().mul_(0.02)
    return nn.Parameter(features)


def make_encoder(config: ModelConfig, local: bool) -> RegionEncoder | GlobalEncoder:
    """Build the region encoder, or the global encoder when `local` is off."""
    return RegionEncoder(config) if local else GlobalEncoder(config)
