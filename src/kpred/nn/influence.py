"""Influence head: how far each keypoint's displacement moves each cage vertex (paper Eq. 1, Fig. 2 D-G)."""

from __future__ import annotations

import torch
from torch import Tensor, nn
from torch.nn import functional

from kpred.nn.config import ModelConfig
from kpred.nn.encoder import make_encoder
from kpred.ops.interpolation import affine_influence
from kpred.ops.typing import Float


class InfluencePredictor(nn.Module):
    """Influence vectors I (keypoints x cage vertices) from the source shape alone."""

    def __init__(self, config: ModelConfig) -> None:
        super().__init__()
        self.config = config
        self.encoder = make_encoder(config, local=config.self_attention)
        self.hidden = nn.ModuleList([nn.Linear(config.width + config.keypoints, 128), nn.Linear(128, 128)])
        self.output = nn.Linear(128, config.cage_vertices)
        if config.influence == "affine":
            # Training starts from the smooth interpolation itself.
            nn.init.zeros_(self.output.weight)
            nn.init.zeros_(self.output.bias)

    def forward(
        self,
        points: Float[Tensor, "batch points 3"],
        keypoints: Float[Tensor, "batch keypoints 3"],
        cage: Float[Tensor, "batch vertices 3"],
    ) -> Float[Tensor, "batch keypoints vertices"]:
        """Predict I with C' = C + I^T (K_target - K_source); all in the source's unit box."""
        tokens = self.encoder(points, keypoints)
        one_hot = torch.eye(self.config.keypoints, dtype=tokens.dtype, device=tokens.device)
        features = torch.cat([tokens, one_hot.expand(len(tokens), -1, -1)], dim=2)
        for layer in self.hidden:
            features = functional.leaky_relu(layer(features), 0.1)
        local = self.output(features) * support(keypoints, cage, self.config.influence_neighbours)
        if self.config.influence == "local":
            return local
        return affine_influence(keypoints, cage) + local


def support(
    keypoints: Float[Tensor, "batch keypoints 3"], cage: Float[Tensor, "batch vertices 3"], neighbours: int
) -> Float[Tensor, "batch keypoints vertices"]:
    """Return 1 for the `neighbours` cage vertices nearest to each keypoint, else 0 (no gradient)."""
    distance = torch.cdist(keypoints.detach(), cage.detach())
    nearest = distance.topk(min(neighbours, cage.shape[1]), dim=2, largest=False).indices
    return torch.zeros_like(distance).scatter_(2, nearest, 1.0)
