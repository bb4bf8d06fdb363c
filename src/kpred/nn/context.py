"""Context block: what the whole cloud says, given back to each of its points (PointNet's pooling, as a residual)."""

from __future__ import annotations

import torch
from torch import Tensor, nn
from torch.nn import functional

from kpred.ops.typing import Float


class ContextBlock(nn.Module):
    """Point features pooled over the cloud and mixed back into every point; starts as the identity.

    One pooling sees points one by one; after a block, the next pooling compares points that already know the cloud,
    from which the unseen part of a shape is predicted.
    """

    def __init__(self, width: int) -> None:
        super().__init__()
        self.wide, self.shape = nn.Linear(width, 2 * width), nn.Linear(2 * width, width)
        self.mix, self.merge = nn.Linear(width, width), nn.Linear(width, width)
        nn.init.zeros_(self.merge.weight)
        nn.init.zeros_(self.merge.bias)

    def forward(self, features: Float[Tensor, "batch points width"]) -> Float[Tensor, "batch points width"]:
        """Transform features, equivariant to the order of points."""
        # The activation rises, so that it may as well follow the pooling: one row a cloud instead of all.
        pooled = functional.leaky_relu(self.wide(features).amax(1), 0.1)
        shape = functional.leaky_relu(self.shape(pooled), 0.1)
        mixed = functional.leaky_relu(self.mix(features).add_(shape[:, None]), 0.1, inplace=True)
        return torch.add(features, self.merge(mixed))
