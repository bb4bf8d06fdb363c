"""Chamfer distances; gradients flow through the arg-min pairs alone."""

from __future__ import annotations

import torch
from torch import Tensor

from kpred.ops.nearest import nearest_neighbours
from kpred.ops.typing import Float


def _matched(points: Tensor, index: Tensor) -> Tensor:
    return torch.gather(points, 1, index[..., None].expand(-1, -1, 3))


def squared_distances(
    query: Float[Tensor, "batch query 3"], reference: Float[Tensor, "batch reference 3"]
) -> Float[Tensor, "batch query"]:
    """Compute the squared distance of every query point to its nearest reference point; differentiable."""
    distance, index = nearest_neighbours(query, reference)
    if not (torch.is_grad_enabled() and (query.requires_grad or reference.requires_grad)):
        return distance
    return (query - _matched(reference, index)).square().sum(-1)


def chamfer_distance(
    target: Float[Tensor, "batch target 3"], result: Float[Tensor, "batch result 3"]
) -> Float[Tensor, " batch"]:
    """Compute CD: mean squared nearest-neighbour distance target to result, plus result to target.

    Unit: the square of the clouds' unit (unit-box squared in training and in the paper's tables).
    """
    return squared_distances(target, result).mean(1) + squared_distances(result, target).mean(1)


def unilateral_chamfer_distance(
    target: Float[Tensor, "batch target 3"], result: Float[Tensor, "batch result 3"]
) -> Float[Tensor, " batch"]:
    """Compute UCD: mean squared distance from each target point to the result (paper Sec. 3.3)."""
    return squared_distances(target, result).mean(1)
