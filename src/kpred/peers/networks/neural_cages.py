"""Neural Cages (Yifan et al., CVPR 2020): a network predicts the source's cage, another where its vertices go.

As published: one PointNet encodes source and target; a sphere of 42 vertices around both is the template; a decoder
moves each of its vertices by the source's code, which makes the source's cage; a second one moves each vertex of that
cage by both codes; mean value coordinates carry the motion to the shape. There are no keypoints.
"""

from __future__ import annotations

from dataclasses import dataclass

import torch
from torch import Tensor, nn
from torch.nn import functional

from kpred.errors import ConfigError
from kpred.nn.plain_config import PlainConfig
from kpred.ops.cage import icosphere
from kpred.ops.mean_value import mean_value_coordinates, mean_value_reference
from kpred.ops.typing import Float
from kpred.peers.networks.pointnet import PointNet

TEMPLATE_RADIUS = 2.0
"""Of the sphere, unit-box units; its faces leave the corners of the unit box inside, so that no coordinate is negative
before training."""


@dataclass(frozen=True)
class NeuralCagesConfig(PlainConfig):
    """Architecture of one category's network.

    Attributes:
        category: name of the category.
        code_size: of a shape's code (256).
        cage_subdivisions: 1 for 42 cage vertices.
    """

    category: str = "chair"
    code_size: int = 256
    cage_subdivisions: int = 1

    def __post_init__(self) -> None:
        if self.code_size < 4 or self.cage_subdivisions < 0:
            raise ConfigError("code_size must be at least 4, cage_subdivisions at least 0.")


class VertexDecoder(nn.Module):
    """A code and a vertex -> the vertex's motion; at first none. The same layers for all vertices."""

    def __init__(self, code_size: int) -> None:
        super().__init__()
        self.code, self.place = nn.Linear(code_size, code_size // 2), nn.Linear(3, code_size // 2, bias=False)
        self.hidden, self.output = nn.Linear(code_size // 2, code_size // 4), nn.Linear(code_size // 4, 3)
        nn.init.zeros_(self.output.weight)
        nn.init.zeros_(self.output.bias)

    def forward(
        self, codes: Float[Tensor, "batch size"], vertices: Float[Tensor, "batch vertices 3"]
    ) -> Float[Tensor, "batch vertices 3"]:
        """Predict the displacement of each vertex."""
        features = functional.leaky_relu(self.code(codes)[:, None] + self.place(vertices), 0.1)
        motion: Tensor = self.output(functional.leaky_relu(self.hidden(features), 0.1))
        return motion


class NeuralCages(nn.Module):
    """Codes of shapes, cages of sources, and how a target moves a cage; all in unit boxes."""

    template: Tensor
    faces: Tensor

    def __init__(self, config: NeuralCagesConfig) -> None:
        super().__init__()
        self.config = config
        vertices, faces = icosphere(config.cage_subdivisions)
        self.register_buffer("template", TEMPLATE_RADIUS * vertices, persistent=False)
        self.register_buffer("faces", faces, persistent=False)
        size = config.code_size
        self.encoder, self.merge = PointNet(size), nn.Linear(2 * size, 2 * size)
        self.cage_decoder, self.motion_decoder = VertexDecoder(size), VertexDecoder(2 * size)

    def encode(self, points: Float[Tensor, "batch points 3"]) -> Float[Tensor, "batch size"]:
        """Encode shapes, sources and targets alike."""
        code: Tensor = functional.leaky_relu(self.encoder(points), 0.1)
        return code

    def cage(self, codes: Float[Tensor, "batch size"]) -> Float[Tensor, "batch vertices 3"]:
        """Predict cages of sources from their codes; the faces are `faces`."""
        template = self.template.expand(len(codes), -1, -1)
        moved: Tensor = template + self.cage_decoder(codes, template)
        return moved

    def coordinates(
        self, points: Float[Tensor, "batch points 3"], cage: Float[Tensor, "batch vertices 3"]
    ) -> Float[Tensor, "batch points vertices"]:
        """Compute mean value coordinates of the source's points, differentiable in the cage."""
        made = mean_value_reference if cage.requires_grad else mean_value_coordinates
        return made(points, cage, self.faces)

    def motion(
        self,
        sources: Float[Tensor, "batch size"],
        targets: Float[Tensor, "batch size"],
        cage: Float[Tensor, "batch vertices 3"],
    ) -> Float[Tensor, "batch vertices 3"]:
        """Predict displacements of cage vertices for pairs of source and target; S' = S + coordinates @ motion."""
        both = functional.leaky_relu(self.merge(torch.cat([sources, targets], dim=1)), 0.1)
        moved: Tensor = self.motion_decoder(both, cage)
        return moved
