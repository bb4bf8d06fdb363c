"""Uy et al. (CVPR 2021): joint learning of retrieval and part-wise deformation, sources known by learned codes.

As published: a target encoder; an auto-decoded code of every source and of each of its parts; a decoder that predicts
from target, source and part how the part's box moves and grows; contacts between parts kept by projection. Retrieval in
an embedding of its own, where every source is a region: a learned centre, and learned widths that say how far it can be
deformed along each direction. Sources are known by their codes alone, so that only sources of the training can be
retrieved.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import torch
from torch import Tensor, nn
from torch.nn import functional

from kpred.errors import ConfigError
from kpred.nn.plain_config import PlainConfig
from kpred.ops.typing import Float, Int
from kpred.peers.networks.known_shapes import CODE_RATE, known_rows
from kpred.peers.networks.part_boxes import PartBoxes
from kpred.peers.networks.pointnet import PointNet

STEP = 0.1
"""What the decoder says is scaled by this (published)."""

REGION_SPREAD = 0.25
"""At first codes are random numbers of deviation 1, those of the retrieval of this one, which makes the first odds
neither even nor certain."""


@dataclass(frozen=True)
class Uy2021Config(PlainConfig):
    """Architecture of one category's network.

    Attributes:
        category: name of the category.
        sources: ids of the source shapes, in the order of their codes.
        parts: most parts of a source; the smallest of one that has more are joined.
        code_size: of targets and sources (256); part_code_size: of each part (32).
    """

    category: str = "chair"
    sources: tuple[str, ...] = ()
    parts: int = 24
    code_size: int = 256
    part_code_size: int = 32

    def __post_init__(self) -> None:
        if min(self.parts, self.code_size, self.part_code_size) < 1:
            raise ConfigError("parts, code_size and part_code_size must be at least 1.")

    def to_dict(self) -> dict[str, Any]:
        """Return plain values for config.json and checkpoints."""
        return {**super().to_dict(), "sources": list(self.sources)}


class Uy2021(nn.Module):
    """Codes of the sources, encoders of targets, and the decoder of part motions; clouds in unit boxes."""

    def __init__(self, config: Uy2021Config) -> None:
        super().__init__()
        self.config = config
        count, size = len(config.sources), config.code_size
        self.target_encoder, self.retrieval_encoder = PointNet(size), PointNet(size)
        self.source_codes = nn.Parameter(torch.randn(count, size) / CODE_RATE)
        self.part_codes = nn.Parameter(torch.randn(count, config.parts, config.part_code_size) / CODE_RATE)
        self.region_centers = nn.Parameter(REGION_SPREAD * torch.randn(count, size) / CODE_RATE)
        self.region_widths = nn.Parameter(torch.zeros(count, size))
        self.decoder = nn.ModuleList([nn.Linear(2 * size + config.part_code_size, 512), nn.Linear(512, 256)])
        self.output = nn.Linear(256, 6)

    def rows(self, model_ids: tuple[str, ...]) -> Int[Tensor, " sources"]:
        """Return rows of the codes of these sources.

        Raises:
            ModelError: if one was not among the sources of the training.
        """
        return known_rows(self.config.sources, model_ids).to(self.source_codes.device)

    def encode(self, targets: Float[Tensor, "batch points 3"]) -> Float[Tensor, "batch size"]:
        """Encode targets for the deformation."""
        code: Tensor = self.target_encoder(targets)
        return code

    def motion(self, codes: Float[Tensor, "batch size"], rows: Int[Tensor, " batch"]) -> Float[Tensor, "batch parts 6"]:
        """Predict how the parts of each source move and grow for its target, before contacts are kept."""
        parts = CODE_RATE * self.part_codes[rows]
        both = torch.cat([codes, CODE_RATE * self.source_codes[rows]], dim=1)
        features = torch.cat([both[:, None].expand(-1, parts.shape[1], -1), parts], dim=2)
        for layer in self.decoder:
            features = functional.leaky_relu(layer(features), 0.1)
        return STEP * self.output(features)

    def deform(
        self,
        codes: Float[Tensor, "batch size"],
        rows: Int[Tensor, " batch"],
        points: Float[Tensor, "batch points 3"],
        boxes: PartBoxes,
    ) -> Float[Tensor, "batch points 3"]:
        """Deform sources (rows of the codes, their points and parts) to targets, one to one."""
        return boxes.moved(points, self.motion(codes, rows))

    def distances(
        self, targets: Float[Tensor, "batch points 3"], rows: Int[Tensor, " sources"]
    ) -> Float[Tensor, "batch sources"]:
        """Compute squared Mahalanobis distances in the retrieval embedding, by each source's widths."""
        place: Tensor = self.retrieval_encoder(targets)
        width = torch.sigmoid(CODE_RATE * self.region_widths[rows])
        return ((place[:, None] - CODE_RATE * self.region_centers[rows]).square() * width).sum(2)
