"""Retrieval tokens, and the region decoder that teaches them geometry and deformation (paper Sec. 3.2, Fig. 3)."""

from __future__ import annotations

import torch
from torch import Tensor, nn
from torch.nn import functional

from kpred.nn.config import ModelConfig
from kpred.nn.encoder import make_encoder
from kpred.ops.typing import Float

DECODED_POINTS = 64


class RetrievalEncoder(nn.Module):
    """Points and keypoints -> a token per keypoint; shapes are compared by the per-keypoint L1 distance of tokens."""

    def __init__(self, config: ModelConfig) -> None:
        super().__init__()
        self.encoder = make_encoder(config, local=config.local_global)
        self.output = nn.Linear(config.width, config.token_size)

    def forward(
        self, points: Float[Tensor, "batch points 3"], keypoints: Float[Tensor, "batch keypoints 3"]
    ) -> Float[Tensor, "batch keypoints token"]:
        """Encode tokens T^(i), in the order of the keypoints; inputs in one unit-box frame."""
        return self.output(self.encoder(points, keypoints))


class RegionDecoder(nn.Module):
    """Psi: (token of keypoint i, all keypoints) -> points of its support region.

    With the shape's own keypoints it must rebuild the region (Psi_1); with another shape's keypoints it must rebuild
    the region after the shape was deformed to them (Psi_2).
    """

    def __init__(self, config: ModelConfig) -> None:
        super().__init__()
        self.config = config
        self.template: Tensor
        self.register_buffer("template", _sphere(DECODED_POINTS) * config.radius, persistent=False)
        context = config.token_size + 4 * config.keypoints
        self.context, self.place = nn.Linear(context, 256), nn.Linear(3, 256, bias=False)
        self.hidden, self.output = nn.Linear(256, 128), nn.Linear(128, 3)

    def forward(
        self, tokens: Float[Tensor, "batch keypoints token"], keypoints: Float[Tensor, "batch keypoints 3"]
    ) -> Float[Tensor, "batch keypoints decoded 3"]:
        """Decode the points of every region, absolute, in the keypoints' frame."""
        batch, count = tokens.shape[:2]
        one_hot = torch.eye(count, dtype=tokens.dtype, device=tokens.device).expand(batch, -1, -1)
        everywhere = keypoints.flatten(1)[:, None].expand(-1, count, -1)
        context = self.context(torch.cat([tokens, everywhere, one_hot], dim=2))
        features = functional.leaky_relu(context[:, :, None] + self.place(self.template), 0.1)
        features = functional.leaky_relu(self.hidden(features), 0.1)
        return keypoints[:, :, None] + self.template + self.output(features)


def _sphere(count: int) -> Tensor:
    """Return points spread evenly over the unit sphere (Fibonacci lattice)."""
    # On the meta device, where weights files are checked, this would load torch's compiler.
    step = torch.arange(count, dtype=torch.float64, device="cpu") + 0.5
    height = 1 - 2 * step / count
    angle = torch.pi * (1 + 5**0.5) * step
    ring = (1 - height.square()).sqrt()
    return torch.stack([ring * angle.cos(), height, ring * angle.sin()], dim=1).float()
