"""Chamfer distances between a target's points and many results at once."""

from __future__ import annotations

import torch
from torch import Tensor

from kpred.ops import squared_distances
from kpred.ops.typing import Float

CHUNK = 64
"""Results that are compared with a target at once."""


def cloud_errors(
    target: Float[Tensor, "target 3"], results: Float[Tensor, "results points 3"], partial: bool = False
) -> Float[Tensor, " results"]:
    """Compute the exact CD between a target and every result; only target to result (UCD) if it is partial.

    All in the unit box; unit box squared.
    """
    errors = []
    for clouds in results.split(CHUNK):
        goal = target.expand(len(clouds), -1, -1)
        forth = squared_distances(goal, clouds).mean(1)
        errors.append(forth if partial else forth + squared_distances(clouds, goal).mean(1))
    return torch.cat(errors)
