"""Keypoint refinement: given a deformation basis, better keypoints are a linear least-squares problem.

Between two nearest-neighbour searches the deformed source S + B d is linear in the keypoint displacements d, with one
K x K matrix shared by x, y and z. Alternating the two lowers a robust, weighted Chamfer distance (or its one-sided form
for partial scans). A prior holds the surface that no point of a partial scan speaks for where the network put it: the
error of the whole surface is that of the seen part, plus how far the unseen part is moved off the best guess there is.
"""

from __future__ import annotations

from dataclasses import dataclass

import torch
from torch import Tensor

from kpred.ops.nearest import nearest_neighbours
from kpred.ops.typing import Float


@dataclass(frozen=True)
class RefineConfig:
    """How keypoints are refined.

    Attributes:
        iterations: rounds of nearest neighbours and least squares.
        points: points of the source and of the target used in each round (all of them are used for the final error).
        prior: weight of the pull toward the network's keypoints, as a share of the data term's mean diagonal.
        unseen: weight of the pull of the surface that a partial scan does not show toward where the network put it,
            against the weight of the points that are seen.
        finalists: candidates that are refined to the end; the others stop after a few quick rounds.
        robust: a point farther from its match than this many times the median distance counts less and less; 0 is off.
    """

    iterations: int = 8
    points: int = 1024
    prior: float = 0.005
    unseen: float = 0.5
    robust: float = 8.0
    finalists: int = 5


UNSEEN_DISTANCE = 0.2
"""A point of the source counts half as unseen at this distance from the scan (unit box)."""


def refine_keypoints(
    points: Float[Tensor, "candidates points 3"],
    basis: Float[Tensor, "candidates points keypoints"],
    displacement: Float[Tensor, "candidates keypoints 3"],
    target: Float[Tensor, "target 3"] | Float[Tensor, "candidates target 3"],
    confidence: Float[Tensor, " keypoints"] | Float[Tensor, "candidates keypoints"],
    config: RefineConfig,
    partial: bool,
    network_displacement: Float[Tensor, "candidates keypoints 3"] | None = None,
) -> Float[Tensor, "candidates keypoints 3"]:
    """Displacements of the source keypoints that bring each candidate closer to the target; all in the unit box.

    Args:
        points: source points of every candidate; basis: their deformation basis B, so that S' = S + B d.
        target: the scan, one for all candidates or one for each.
        displacement: the start; the network's K_target - K_source unless that is given too.
        confidence: D_i in [0, 1], for all candidates or for each; in a partial scan a keypoint of low confidence is
            held more by the prior, beside what holds the unseen surface.
        network_displacement: the centre of the prior, where refinement goes on from another start.
        partial: only target-to-source distances count, since the unseen part of the source has nothing to match.
    """
    source_step = max(1, points.shape[1] // config.points)
    target_step = max(1, target.shape[-2] // config.points)
    few, few_basis = points[:, ::source_step], basis[:, ::source_step].contiguous()
    goal = target[..., ::target_step, :].expand(len(points), -1, -1).contiguous()
    start, current = displacement if network_displacement is None else network_displacement, displacement
    hold = 1.0 + 4.0 * (1.0 - confidence) if partial else torch.ones_like(confidence)
    unseen = config.unseen * _unseen_normal(few, few_basis, start, goal) if partial else 0.0
    for _ in range(config.iterations):
        moved = few + few_basis @ current
        squared, index = nearest_neighbours(goal, moved)
        rows = _rows(few_basis, index)
        residual = goal - _rows(few, index)
        weight = _robust_weight(squared, config.robust) / goal.shape[1]
        normal = rows.transpose(1, 2) @ (rows * weight[..., None])
        right = rows.transpose(1, 2) @ (residual * weight[..., None])
        if not partial:
            squared, index = nearest_neighbours(moved, goal)
            weight = _robust_weight(squared, config.robust) / few.shape[1]
            normal = normal + few_basis.transpose(1, 2) @ (few_basis * weight[..., None])
            right = right + few_basis.transpose(1, 2) @ ((_rows(goal, index) - few) * weight[..., None])
        scale = normal.diagonal(dim1=1, dim2=2).mean(1)[:, None]
        held = torch.diag_embed(config.prior * scale * hold) + unseen
        current = torch.linalg.solve(normal + held, right + held @ start)
    return current


def _unseen_normal(points: Tensor, basis: Tensor, displacement: Tensor, goal: Tensor) -> Tensor:
    """Normal matrix (C, K, K) of how far corrections of the keypoints move the surface that the scan does not show.

    In these units the mean of the data term's matrix is that of the seen points. Keypoints that move only what is seen
    stay free, and those that share unseen surface are held together.
    """
    step = 2 if points.shape[1] > 256 else 1
    moved = (points + basis @ displacement)[:, ::step].contiguous()
    squared, _ = nearest_neighbours(moved, goal)
    share = squared.square() / (squared.square() + UNSEEN_DISTANCE**4) / moved.shape[1]
    rows = basis[:, ::step]
    return rows.transpose(1, 2) @ (rows * share[..., None])


def _rows(values: Tensor, index: Tensor) -> Tensor:
    return torch.gather(values, 1, index[..., None].expand(-1, -1, values.shape[-1]))


def _robust_weight(squared: Tensor, robust: float) -> Tensor:
    """Geman-McClure weights with a scale from the median distance, so that clean full scans are hardly touched."""
    if robust <= 0:
        return torch.ones_like(squared)
    scale = squared.median(dim=1, keepdim=True).values * robust**2 + 1e-4
    return (scale / (scale + squared)).square()
