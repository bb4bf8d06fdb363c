"""Expected visibility: how surely surface at a place would have been seen by the scanner that made a cloud."""

from __future__ import annotations

from dataclasses import dataclass

import torch
from torch import Tensor, nn
from torch.nn import functional

from kpred.errors import ConfigError
from kpred.nn.context import ContextBlock
from kpred.nn.plain_config import PlainConfig
from kpred.ops.nearest import nearest_neighbours
from kpred.ops.typing import Float

QUERY_RANGE = 3.0
"""Queries farther from the middle than this many half sides of the scan's box are moved to that distance, per axis."""

KEY_SIZE = 32
"""Channels of keys and values that places attend to."""

SCAN_POINTS = 512
"""Points of a scan that the network is trained for at most."""


@dataclass(frozen=True)
class VisibilityConfig(PlainConfig):
    """Architecture of a visibility network.

    Attributes:
        width: channels of the point and query features.
        blocks: context blocks.
    """

    width: int = 64
    blocks: int = 1

    def __post_init__(self) -> None:
        if self.width < 1 or self.blocks < 0:
            raise ConfigError(
                f"A visibility network needs a positive width and no negative number of blocks, but has {self.width} "
                f"and {self.blocks}."
            )


class VisibilityNetwork(nn.Module):
    """PointNet with context blocks over a scan, and a decoder of places around it.

    A place is decoded from the scan's feature, its position, its offset from the nearest scan point, that point's
    feature, and what it attends to among all points. Scans and places are in one frame of any unit, y up, front about
    +z. Trained on scans of up to `SCAN_POINTS` points: `thinned` makes such a scan.
    """

    def __init__(self, config: VisibilityConfig) -> None:
        super().__init__()
        self.config = config
        width = config.width
        self.local = nn.ModuleList([nn.Linear(3, 64), nn.Linear(64, width)])
        self.context = nn.ModuleList([ContextBlock(width) for _ in range(config.blocks)])
        self.wide = nn.Linear(width, 2 * width)
        self.shape = nn.ModuleList([nn.Linear(4 * width, 2 * width), nn.Linear(2 * width, width)])
        self.nearest = nn.Linear(width, width, bias=False)
        self.place = nn.Linear(7, width)
        # Scores are bilinear: with |p|^2 beside p they can express distances, which lets places attend by position.
        self.query = nn.Linear(width + 3, KEY_SIZE)
        self.key_value = nn.Linear(width + 4, 2 * KEY_SIZE)
        self.attended = nn.Linear(KEY_SIZE, width)
        self.decoder = nn.ModuleList([nn.Linear(width, width), nn.Linear(width, width)])
        self.output = nn.Linear(width, 1)

    def forward(
        self, points: Float[Tensor, "batch points 3"], queries: Float[Tensor, "batch queries 3"]
    ) -> Float[Tensor, "batch queries"]:
        """Predict logits of visibility at queries (unit of the points)."""
        middle, half = robust_box(points)
        scan = (points - middle) / half
        places = ((queries - middle) / half).clamp(-QUERY_RANGE, QUERY_RANGE)
        features, shape = self._encode(scan)
        squared, index = nearest_neighbours(places, scan)
        offset = places - torch.gather(scan, 1, index[..., None].expand(-1, -1, 3))
        near = self.nearest(features)
        near = torch.gather(near, 1, index[..., None].expand(-1, -1, near.shape[2]))
        inputs = torch.cat([places, offset, squared.sqrt()[..., None].to(places)], dim=2)
        decoded = functional.leaky_relu(self.place(inputs) + near + shape[:, None], 0.1)
        query = self.query(torch.cat([decoded, places], dim=2))
        located = torch.cat([features, scan, scan.square().sum(2, keepdim=True)], dim=2)
        key, value = self.key_value(located).chunk(2, dim=2)
        # Plain products train several times as fast on a CPU as torch's fused attention, and predict as fast.
        weights = torch.softmax(query @ key.mT / KEY_SIZE**0.5, dim=2)
        decoded = decoded + self.attended(weights @ value)
        for layer in self.decoder:
            decoded = functional.leaky_relu(layer(decoded), 0.1)
        return self.output(decoded)[..., 0]

    def _encode(self, scan: Tensor) -> tuple[Tensor, Tensor]:
        """Encode features of the points (batch, points, width), and of the scan (batch, width)."""
        features = scan
        for layer in self.local:
            features = functional.leaky_relu(layer(features), 0.1)
        for block in self.context:
            features = block(features)
        wide = functional.leaky_relu(self.wide(features), 0.1)
        shape = torch.cat([wide.amax(1), wide.mean(1)], dim=1)
        shape = functional.leaky_relu(self.shape[0](shape), 0.1)
        return features, self.shape[1](shape)

    @torch.inference_mode()
    def grid(
        self,
        points: Float[Tensor, "points 3"],
        size: int,
        low: Float[Tensor, "3"],
        high: Float[Tensor, "3"],
    ) -> Float[Tensor, "size size size"]:
        """Predict probabilities of visibility at grid nodes, x by y by z, over a box (unit of the points).

        The first nodes lie at `low`, the last at `high`. Of many points, `SCAN_POINTS` at even steps are used.
        """
        used = thinned(points[None])
        steps = torch.linspace(0.0, 1.0, size, dtype=points.dtype, device=points.device)
        axes = low[:, None] + (high - low)[:, None] * steps
        nodes = torch.cartesian_prod(*axes)
        return torch.sigmoid(self(used, nodes[None]))[0].view(size, size, size)


def thinned(points: Float[Tensor, "batch points 3"]) -> Float[Tensor, "batch few 3"]:
    """Take `SCAN_POINTS` points of each cloud at even steps (unit of the clouds), or all where there are fewer."""
    count = points.shape[1]
    if count <= SCAN_POINTS:
        return points
    return points[:, torch.arange(SCAN_POINTS, device=points.device) * count // SCAN_POINTS]


def robust_box(
    points: Float[Tensor, "batch points 3"],
) -> tuple[Float[Tensor, "batch 1 3"], Float[Tensor, "batch 1 1"]]:
    """Measure the middle, and half the longest side, of the box of each cloud's middle 96 % along each axis."""
    ordered = points.sort(dim=1).values
    cut = points.shape[1] // 50
    low, high = ordered[:, cut], ordered[:, points.shape[1] - 1 - cut]
    half = ((high - low).amax(1) / 2).clamp(min=torch.finfo(points.dtype).tiny)
    return ((low + high) / 2)[:, None], half[:, None, None]
