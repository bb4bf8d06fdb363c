"""The two small networks of detection: whether two pieces are of one object, and what a proposal is."""

from __future__ import annotations

import os
from functools import cache
from importlib import resources
from pathlib import Path

import torch
from torch import Tensor, nn
from torch.nn import functional

from kpred.detection.adjacency import PAIR_FEATURES
from kpred.nn.context import ContextBlock
from kpred.nn.weights import load_weights, save_weights
from kpred.ops.typing import Float

CATEGORIES = ("chair", "table", "cabinet")

CHANNELS = 10
"""Of a point: x, y, height (metres), own, structure, squared vertical part of its normal, height in the box, cosine and
sine part of its normal in plan, affinity of its piece.
"""

FACTS = 10
"""Of a proposal: amount, sides, lower and upper end, area and cells to the area of its box, affinities."""

WIDTH, DROPOUT = 48, 0.15


class PairNetwork(nn.Module):
    """Log-odds that two touching pieces are of one object."""

    def __init__(self) -> None:
        super().__init__()
        self.mean, self.deviation = nn.Buffer(torch.zeros(PAIR_FEATURES)), nn.Buffer(torch.ones(PAIR_FEATURES))
        self.layers = nn.ModuleList([nn.Linear(PAIR_FEATURES, 64), nn.Linear(64, 32)])
        self.output = nn.Linear(32, 1)

    def forward(self, features: Float[Tensor, "pairs features"]) -> Float[Tensor, " pairs"]:
        """Predict log-odds from `kpred.detection.adjacency.pair_features`."""
        hidden = ((features - self.mean) / self.deviation).clamp(-6.0, 6.0)
        for layer in self.layers:
            hidden = functional.leaky_relu(layer(hidden), 0.1)
        return self.output(hidden)[:, 0]


class ProposalNetwork(nn.Module):
    """Category of a proposal and how well it covers one object, from its points and those around it."""

    def __init__(self) -> None:
        super().__init__()
        self.local = nn.ModuleList([nn.Linear(CHANNELS, WIDTH), nn.Linear(WIDTH, WIDTH)])
        self.context = ContextBlock(WIDTH)
        self.wide = nn.Linear(WIDTH, 2 * WIDTH)
        self.shape = nn.ModuleList([nn.Linear(6 * WIDTH + FACTS, 2 * WIDTH), nn.Linear(2 * WIDTH, WIDTH)])
        self.output = nn.Linear(WIDTH, len(CATEGORIES) + 2)

    def forward(
        self, points: Float[Tensor, "batch points channels"], facts: Float[Tensor, "batch facts"]
    ) -> tuple[Float[Tensor, "batch answers"], Float[Tensor, " batch"]]:
        """Predict logits of the categories and, last, of none; and the logit of the IoU with the object.

        Args:
            points: channel 3 is 1 for own points; facts: of the whole proposal (`crops.proposal_crops`).
        """
        hidden = points
        for layer in self.local:
            hidden = functional.leaky_relu(layer(hidden), 0.1)
        hidden = functional.leaky_relu(self.wide(self.context(hidden)), 0.1)
        own = points[:, :, 3:4]
        pools = [
            (hidden - 1e3 * (1 - own)).amax(1),
            (hidden * own).sum(1) / own.sum(1).clamp(min=1.0),
            (hidden - 1e3 * own).amax(1).clamp(min=-1.0),
        ]
        shape = torch.cat([functional.dropout(torch.cat(pools, dim=1), DROPOUT, self.training), facts], dim=1)
        for layer in self.shape:
            shape = functional.dropout(functional.leaky_relu(layer(shape), 0.1), DROPOUT, self.training)
        answers = self.output(shape)
        return answers[:, :-1], answers[:, -1]


class Detector(nn.Module):
    """Both networks."""

    def __init__(self) -> None:
        super().__init__()
        self.pairs, self.proposals = PairNetwork(), ProposalNetwork()

    def save(self, folder: str | os.PathLike[str]) -> None:
        """Write config.json and model.safetensors in half precision.

        Raises:
            OutputError: the folder cannot be written.
        """
        save_weights(self, {"categories": list(CATEGORIES)}, Path(folder), torch.float16)

    @classmethod
    def load(cls, folder: str | os.PathLike[str]) -> Detector:
        """Read a detector.

        Raises:
            ModelError: a file is missing or damaged.
        """
        return load_weights(Path(folder), lambda _: cls(), "cpu")


@cache
def bundled_detector() -> Detector:
    """Load the bundled detector, once.

    Raises:
        ModelError: it is missing, as in a damaged installation.
    """
    return Detector.load(Path(str(resources.files("kpred"))) / "bundled" / "detector")
