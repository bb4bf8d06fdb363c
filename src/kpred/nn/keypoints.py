"""Keypoint predictor: 12 semantic keypoints from a cloud in the unit box (paper Fig. 2, R-B)."""

from __future__ import annotations

import torch
from torch import Tensor, nn
from torch.nn import functional

from kpred.nn.config import ModelConfig
from kpred.nn.context import ContextBlock
from kpred.ops.typing import Float

INFERENCE_POINTS = 1024
"""Points that the predictor is given of a scan or a CAD model; it gains nothing from more."""


def thinned(points: Float[Tensor, "batch points 3"]) -> Float[Tensor, "batch few 3"]:
    """Select evenly spaced rows, at least INFERENCE_POINTS of them where there are so many."""
    return points[:, :: max(1, points.shape[1] // INFERENCE_POINTS)]


class KeypointPredictor(nn.Module):
    """PointNet on raw coordinates, then keypoints from its global feature or by votes of the points.

    `regression` is the published head. `voting` gives each point a say in each keypoint: K_i = sum_p w_ip (p + o_ip)
    with softmax weights over the points. Being anchored to the points, it follows proportions never seen in training.
    `blocks` more rounds of pooling (voting only) are for partial clouds, whose unseen part depends on the whole cloud.
    """

    def __init__(self, config: ModelConfig, blocks: int = 0) -> None:
        super().__init__()
        self.config = config
        self.local = nn.ModuleList([nn.Linear(3, 64), nn.Linear(64, 128)])
        self.wide = nn.Linear(128, 256)
        self.shape = nn.ModuleList([nn.Linear(256, 256), nn.Linear(256, 256)])
        if config.keypoint_head == "regression":
            self.head = nn.ModuleList([nn.Linear(256, 512), nn.Linear(512, 256)])
            self.output = nn.Linear(256, 3 * config.keypoints)
        else:
            self.mix_local, self.mix_shape = nn.Linear(128, 128), nn.Linear(256, 128, bias=False)
            self.context = nn.ModuleList([ContextBlock(128) for _ in range(blocks)])
            self.head = nn.ModuleList([nn.Linear(128, 128)])
            self.output = nn.Linear(128, 4 * config.keypoints)

    def forward(self, points: Float[Tensor, "batch points 3"]) -> Float[Tensor, "batch keypoints 3"]:
        """Predict keypoints in the points' own unit-box frame, clamped to [-1.2, 1.2]."""
        features = points
        for layer in self.local:
            features = functional.leaky_relu(layer(features), 0.1, inplace=True)
        # The activation rises, so that it may as well follow the pooling.
        shape = functional.leaky_relu(self.wide(features).amax(1), 0.1)
        for layer in self.shape:
            shape = functional.leaky_relu(layer(shape), 0.1)
        if self.config.keypoint_head == "regression":
            for layer in self.head:
                shape = functional.leaky_relu(layer(shape), 0.1)
            return self.output(shape).unflatten(1, (self.config.keypoints, 3)).clamp(-1.2, 1.2)
        mixed = functional.leaky_relu(self.mix_local(features).add_(self.mix_shape(shape)[:, None]), 0.1, inplace=True)
        for block in self.context:
            mixed = block(mixed)
        for layer in self.head:
            mixed = functional.leaky_relu(layer(mixed), 0.1, inplace=True)
        votes = self.output(mixed)
        score, offset = votes.split([self.config.keypoints, 3 * self.config.keypoints], dim=2)
        weight = torch.softmax(score, dim=1)
        anchored = weight.transpose(1, 2) @ points
        shift = (weight[..., None] * offset.unflatten(2, (self.config.keypoints, 3))).sum(1)
        return (anchored + shift).clamp(-1.2, 1.2)
