"""U-RED (Di et al., ICCV 2023): parts deformed by attention, sources retrieved by the residual that would be left.

As published: a PointNet encodes the sources, its features pooled over each part are the parts' codes; attention
between parts, source and target says how the parts' boxes move and grow, contacts kept by projection. For every point
of the target a network predicts, from the point's feature and the codes of target and source, the nearest point of the
deformed source; the source with the shortest of these residuals is retrieved, without being deformed.
Partial targets have a branch of their own, whose residual depends on a point of the unit sphere too: one partial shape
may belong to many whole ones, and each point of the sphere stands for one of them.
"""

from __future__ import annotations

from dataclasses import dataclass

from torch import Tensor, nn
from torch.nn import functional

from kpred.errors import ConfigError
from kpred.nn.plain_config import PlainConfig
from kpred.ops.typing import Float, Int
from kpred.peers.networks.part_attention import PartAttention
from kpred.peers.networks.part_boxes import PartBoxes
from kpred.peers.networks.pointnet import POINT_FEATURES, PointNet


@dataclass(frozen=True)
class URedConfig(PlainConfig):
    """Architecture of one category's network.

    Attributes:
        category: name of the category.
        parts: most parts of a source; the smallest of one that has more are joined.
        width: of the attention (256 in the publication); rounds of it (2); heads of each (4).
    """

    category: str = "chair"
    parts: int = 24
    width: int = 128
    rounds: int = 2
    heads: int = 4

    def __post_init__(self) -> None:
        if min(self.parts, self.width, self.rounds, self.heads) < 1 or self.width % self.heads:
            raise ConfigError("parts, width, rounds and heads must be at least 1, and the heads must divide the width.")


class PointDecoder(nn.Module):
    """A point's feature and codes that it shares with its cloud -> three numbers for the point."""

    def __init__(self, codes: int) -> None:
        super().__init__()
        self.point = nn.Linear(POINT_FEATURES, 256)
        self.codes = nn.ModuleList([nn.Linear(POINT_FEATURES, 256, bias=False) for _ in range(codes)])
        self.later = nn.ModuleList([nn.Linear(256, 256), nn.Linear(256, 32)])
        self.output = nn.Linear(32, 3)

    def forward(
        self,
        features: Float[Tensor, "_ points 256"],
        *codes: Float[Tensor, "_ 256"],
        rows: Int[Tensor, " _"] | None = None,
    ) -> Float[Tensor, "_ points 3"]:
        """Decode numbers of each point; a batch of one is repeated for all codes.

        Args:
            rows: of the features, which of them belong to each code; without it they are in the codes' order.
        """
        mixed = self.point(features)
        if rows is not None:
            mixed = mixed[rows]
        for layer, code in zip(self.codes, codes, strict=True):
            mixed = mixed + layer(code)[:, None]
        for layer in self.later:
            mixed = layer(functional.leaky_relu(mixed, 0.1))
        found: Tensor = self.output(functional.leaky_relu(mixed, 0.1))
        return found


class Branch(nn.Module):
    """What whole targets and partial ones each have of their own: encoder, deformation, residuals, reconstruction."""

    def __init__(self, config: URedConfig, codes: int) -> None:
        super().__init__()
        self.encoder = PointNet(POINT_FEATURES)
        self.deformation = PartAttention(POINT_FEATURES, config.width, config.rounds, config.heads)
        self.residual = PointDecoder(codes)
        self.reconstruction = PointDecoder(1)

    def start_from(self, other: Branch) -> None:
        """Take over the weights of another branch; codes that it does not know keep their own."""
        self.load_state_dict(other.state_dict(), strict=False)


class URed(nn.Module):
    """Encoder of sources, and the branches; clouds in unit boxes."""

    def __init__(self, config: URedConfig) -> None:
        super().__init__()
        self.config = config
        self.source_encoder, self.source_reconstruction = PointNet(POINT_FEATURES), PointDecoder(1)
        self.whole, self.partial = Branch(config, codes=2), Branch(config, codes=3)

    def part_codes(self, features: Float[Tensor, "batch points 256"], boxes: PartBoxes) -> Tensor:
        """Average the features of each part's points, (batch, parts, 256); zero for empty parts."""
        count = boxes.parts.shape[-1]
        member = functional.one_hot(boxes.labels, count).to(features.dtype)
        return member.transpose(1, 2) @ features / member.sum(1).clamp(min=1)[..., None]

    @staticmethod
    def score(residuals: Float[Tensor, "batch points 3"]) -> Float[Tensor, " batch"]:
        """Compute the retrieval score: the mean L1 length of the residuals (unit box)."""
        return residuals.abs().sum(2).mean(1)
