"""Box of the whole object from a partial scan: where the unseen part ends, and how sure that is."""

from __future__ import annotations

import torch
from torch import Tensor, nn
from torch.nn import functional

from kpred.nn.context import ContextBlock
from kpred.ops.typing import Float


class BoxPredictor(nn.Module):
    """PointNet that extends the visible box of a partial cloud to the box of its whole object."""

    def __init__(self, blocks: int = 0) -> None:
        super().__init__()
        self.local = nn.ModuleList([nn.Linear(3, 64), nn.Linear(64, 128), nn.Linear(128, 256)])
        self.context = nn.ModuleList([ContextBlock(128) for _ in range(blocks)])
        self.shape = nn.ModuleList([nn.Linear(256, 256), nn.Linear(256, 128)])
        self.output = nn.Linear(128, 12)
        # The start is the visible box itself, with an error of about 0.2.
        nn.init.zeros_(self.output.weight)
        nn.init.zeros_(self.output.bias)

    def forward(
        self, points: Float[Tensor, "batch points 3"]
    ) -> tuple[Float[Tensor, "batch 2 3"], Float[Tensor, "batch 2 3"]]:
        """Predict the corners (lowest, highest) of the whole object's box, and their mean absolute errors.

        Points fill their own unit box; so are the results stated.
        """
        features = points
        for layer in self.local[:2]:
            features = functional.leaky_relu(layer(features), 0.1, inplace=True)
        for block in self.context:
            features = block(features)
        shape = functional.leaky_relu(self.local[2](features).amax(1), 0.1)
        for layer in self.shape:
            shape = functional.leaky_relu(layer(shape), 0.1)
        extension, spread = self.output(shape).unflatten(1, (2, 2, 3)).unbind(1)
        visible = torch.stack([points.amin(1), points.amax(1)], dim=1)
        return visible + extension, 0.2 * spread.clamp(-4, 3).exp()
