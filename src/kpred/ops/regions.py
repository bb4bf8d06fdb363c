"""Support regions: the points in a ball around each keypoint, and how far their density is to be trusted."""

from __future__ import annotations

import torch
from torch import Tensor

from kpred.ops.nearest import squared_distance_matrix
from kpred.ops.typing import Float, Int


def ball_query(
    points: Float[Tensor, "batch points 3"],
    centers: Float[Tensor, "batch centers 3"],
    radius: float,
    count: int,
) -> tuple[Int[Tensor, "batch centers count"], Int[Tensor, "batch centers"]]:
    """Find up to `count` points within `radius` of each centre (paper Sec. 3.1: r = 0.3 in the unit box).

    Returns:
        Indices into `points`, evenly spread over the ball's members in their order; short regions repeat members, an
        empty region repeats the point nearest to the centre. And the number of all points inside each ball.
    """
    squared = squared_distance_matrix(centers, points)
    inside = squared <= radius**2
    total = inside.sum(-1)
    # Members first, in their order: each member is written to the slot of its rank, all others to a last, unused slot.
    slots = points.shape[1]
    rank_of = torch.where(inside, inside.cumsum(-1) - 1, slots)
    order = torch.zeros(*inside.shape[:2], slots + 1, dtype=torch.long, device=points.device)
    order.scatter_(2, rank_of, torch.arange(slots, device=points.device).expand_as(rank_of))
    slot = torch.arange(count, device=points.device)
    available = total.clamp(min=1)[..., None]
    rank = torch.where(available > count, slot * available // count, slot % available)
    index = torch.gather(order, 2, rank)
    nearest = squared.argmin(-1)
    return torch.where(total[..., None] > 0, index, nearest[..., None]), total


def ball_counts(
    points: Float[Tensor, "batch points 3"], centers: Float[Tensor, "batch centers 3"], radius: float
) -> Int[Tensor, "batch centers"]:
    """Count the points within `radius` of each centre."""
    return (squared_distance_matrix(centers, points) <= radius**2).sum(-1)


def gather_points(
    values: Float[Tensor, "batch points channels"], index: Int[Tensor, "batch centers count"]
) -> Float[Tensor, "batch centers count channels"]:
    """Gather rows of `values` by the indices of `ball_query`."""
    batch = torch.arange(len(values), device=values.device)[:, None, None]
    return values[batch, index]


def density_confidence(
    counts: Int[Tensor, "batch centers"], points: int, radius: float, alpha: float
) -> Float[Tensor, "batch centers"]:
    """Compute d_i = min(N_R / (alpha V), 1), the paper's confidence of a keypoint (Sec. 3.3).

    Args:
        counts: N_R, points inside the ball around each keypoint.
        points: size of the cloud; `alpha` is stated for 2048 points, so counts of other sizes are brought to that.
        radius: ball radius in unit-box units; V is the ball's volume.
        alpha: points per unit-box volume at which a region counts as fully seen.
    """
    volume = 4.0 / 3.0 * torch.pi * radius**3
    return (counts.float() * (2048.0 / points) / (alpha * volume)).clamp(max=1.0)
