"""ShapeFlow (Jiang et al., NeurIPS 2020): shapes flow through a common hub, each along its own learned code.

As published: every shape has an auto-decoded code; a network of place and code is a velocity, scaled by the length of
the code; from a shape to the hub the code shrinks to zero, from the hub to a shape it grows, so that one flow is the
other backwards and every deformation can be undone. Points are carried by Runge-Kutta steps. A target that was not
trained is given a code by descent on the distance of flown sources; sources are retrieved by the distance of codes.
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

FAR = 1.5
"""Beyond this distance from the middle the velocity away from it grows no faster than the distance: else a point that
leaves the unit box is at infinity in no time."""

CODE_SPREAD = 0.1
"""Standard deviation of the codes before training."""


@dataclass(frozen=True)
class ShapeFlowConfig(PlainConfig):
    """Architecture of one category's network.

    Attributes:
        category: name of the category.
        sources: ids of all shapes that have a code, sources or targets of the training, in the order of the codes.
        code_size: of a shape's code; width: of the velocity's three layers.
        steps: Runge-Kutta steps (fourth order) between hub and shape.
        symmetric: whether the flow is its own mirror image, left and right (x).
    """

    category: str = "chair"
    sources: tuple[str, ...] = ()
    code_size: int = 64
    width: int = 128
    steps: int = 4
    symmetric: bool = True

    def __post_init__(self) -> None:
        if min(self.code_size, self.width, self.steps) < 1:
            raise ConfigError("code_size, width and steps must be at least 1.")

    def to_dict(self) -> dict[str, Any]:
        """Return plain values for config.json and checkpoints."""
        return {**super().to_dict(), "sources": list(self.sources)}


class ShapeFlow(nn.Module):
    """Codes of the shapes, and the flow between a shape and the hub; clouds in unit boxes."""

    def __init__(self, config: ShapeFlowConfig) -> None:
        super().__init__()
        self.config = config
        size, width = config.code_size, config.width
        self.codes = nn.Parameter(CODE_SPREAD * torch.randn(len(config.sources), size) / CODE_RATE)
        self.places = nn.ModuleList([nn.Linear(3, width) for _ in range(3)])
        self.of_codes = nn.ModuleList([nn.Linear(size, width, bias=False) for _ in range(3)])
        self.mixing = nn.ModuleList([nn.Linear(width, width, bias=False) for _ in range(2)])
        self.output = nn.Linear(width, 3)

    def rows(self, model_ids: tuple[str, ...]) -> Int[Tensor, " shapes"]:
        """Return rows of the codes of these shapes.

        Raises:
            ModelError: if one was not among the shapes of the training.
        """
        return known_rows(self.config.sources, model_ids).to(self.codes.device)

    def code(self, rows: Int[Tensor, " batch"]) -> Float[Tensor, "batch size"]:
        """Return codes by row."""
        return CODE_RATE * self.codes[rows]

    def velocity(
        self, points: Float[Tensor, "batch points 3"], codes: Float[Tensor, "batch size"]
    ) -> Float[Tensor, "batch points 3"]:
        """Predict the velocity at each place under a code between hub and shape, before scaling."""
        features, side = points.new_zeros(()), points[..., :1]
        if self.config.symmetric:
            points = torch.cat([side.abs(), points[..., 1:]], dim=-1)
        for layer, (place, code) in enumerate(zip(self.places, self.of_codes, strict=True)):
            known = place(points) + code(codes)[:, None]
            features = functional.elu(known if layer == 0 else known + self.mixing[layer - 1](features))
        found: Tensor = self.output(features)
        if self.config.symmetric:  # nothing crosses the middle
            found = torch.cat([side.clamp(-FAR, FAR) * found[..., :1], found[..., 1:]], dim=-1)
        return found

    def from_hub(
        self, points: Float[Tensor, "batch points 3"], codes: Float[Tensor, "batch size"]
    ) -> Float[Tensor, "batch points 3"]:
        """Carry points of the hub to the shapes of these codes."""
        return self._flown(points, codes, 0.0, 1.0)

    def to_hub(
        self, points: Float[Tensor, "batch points 3"], codes: Float[Tensor, "batch size"]
    ) -> Float[Tensor, "batch points 3"]:
        """Carry points of the shapes of these codes to the hub."""
        return self._flown(points, codes, 1.0, 0.0)

    def _flown(self, points: Tensor, codes: Tensor, begin: float, end: float) -> Tensor:
        # Not the norm, which has no gradient at zero, where the descent for an unknown target begins.
        speed = (codes.square().sum(1) + 1e-12).sqrt()[:, None, None]
        step = (end - begin) / self.config.steps

        def slope(time: float, place: Tensor) -> Tensor:
            return speed * self.velocity(place, time * codes)

        for done in range(self.config.steps):
            time = begin + done * step
            first = slope(time, points)
            second = slope(time + step / 2, points + step / 2 * first)
            third = slope(time + step / 2, points + step / 2 * second)
            fourth = slope(time + step, points + step * third)
            points = points + step / 6 * (first + 2 * second + 2 * third + fourth)
        return points
