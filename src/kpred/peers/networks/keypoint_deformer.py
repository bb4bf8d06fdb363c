"""KeypointDeformer (Jakab et al., CVPR 2021): unsupervised keypoints move a cage, by a global feature of the source.

As published: a PointNet regresses the keypoints; the cage is an icosphere of 42 vertices pulled in to the source; the
influence of keypoints on cage vertices is one learned matrix for the category plus an offset that a second PointNet
predicts from the source; each keypoint reaches its 5 nearest cage vertices; mean value coordinates carry the cage's
motion to the shape.
"""

from __future__ import annotations

from dataclasses import dataclass

import torch
from torch import Tensor, nn

from kpred.errors import ConfigError
from kpred.nn.config import ModelConfig
from kpred.nn.influence import support
from kpred.nn.keypoints import KeypointPredictor
from kpred.nn.plain_config import PlainConfig
from kpred.ops.cage import pulled_in_cage
from kpred.ops.typing import Float
from kpred.peers.networks.pointnet import PointNet

SHARED_RATE = 10.0
"""The shared influence learns so much faster than the networks (published). Adam's steps do not depend on the scale of
a parameter, so that a parameter that counts tenfold learns tenfold."""


@dataclass(frozen=True)
class KeypointDeformerConfig(PlainConfig):
    """Architecture of one category's network.

    Attributes:
        category: name of the category.
        keypoints: number of keypoints (12).
        influence_neighbours: cage vertices, those nearest to it, that a keypoint moves (5).
        cage_subdivisions: 1 for 42 cage vertices.
    """

    category: str = "chair"
    keypoints: int = 12
    influence_neighbours: int = 5
    cage_subdivisions: int = 1

    def __post_init__(self) -> None:
        if min(self.keypoints, self.influence_neighbours) < 1 or self.cage_subdivisions < 0:
            raise ConfigError("keypoints and influence_neighbours must be at least 1, cage_subdivisions at least 0.")

    @property
    def cage_vertices(self) -> int:
        """Vertices of the cage."""
        return self.model_config().cage_vertices

    def model_config(self) -> ModelConfig:
        """Convert the settings to this package's own, for parts that are the same."""
        return ModelConfig(
            category=self.category,
            keypoints=self.keypoints,
            keypoint_head="regression",
            influence_neighbours=self.influence_neighbours,
            cage="pulled",
            cage_subdivisions=self.cage_subdivisions,
        )


class KeypointDeformer(nn.Module):
    """Keypoints of any shape, and how those of a source move its cage; all in unit boxes."""

    def __init__(self, config: KeypointDeformerConfig) -> None:
        super().__init__()
        self.config = config
        self.keypoint_predictor = KeypointPredictor(config.model_config())
        self.shared_influence = nn.Parameter(torch.zeros(config.keypoints, config.cage_vertices))
        self.influence_offset = PointNet(config.keypoints * config.cage_vertices)

    def keypoints(self, points: Float[Tensor, "batch points 3"]) -> Float[Tensor, "batch keypoints 3"]:
        """Predict keypoints of whole shapes, clamped to the unit box."""
        found: Tensor = self.keypoint_predictor(points)
        return found.clamp(-1, 1)

    def cage(self, points: Float[Tensor, "batch points 3"]) -> Float[Tensor, "batch vertices 3"]:
        """Build the source's cage; its faces are those of `kpred.ops.cage.icosphere`."""
        return pulled_in_cage(points, subdivisions=self.config.cage_subdivisions)

    def offset(self, points: Float[Tensor, "batch points 3"]) -> Float[Tensor, "batch keypoints vertices"]:
        """Predict the offset of the source's influence from the shared one."""
        found: Tensor = self.influence_offset(points)
        return found.unflatten(1, (self.config.keypoints, self.config.cage_vertices))

    def influence(
        self,
        offset: Float[Tensor, "batch keypoints vertices"],
        keypoints: Float[Tensor, "batch keypoints 3"],
        cage: Float[Tensor, "batch vertices 3"],
    ) -> Float[Tensor, "batch keypoints vertices"]:
        """Return I with C' = C + I^T (K_target - K_source)."""
        return (SHARED_RATE * self.shared_influence + offset) * support(
            keypoints, cage, self.config.influence_neighbours
        )
