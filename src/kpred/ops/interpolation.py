"""Influence of keypoints on cage vertices without learning: smooth interpolation that reproduces affine maps.

The learned influence of `kpred.nn.influence` is a correction on top of this one where the config enables it; alone it
is the deformer of the no-learning baseline.
"""

from __future__ import annotations

from typing import Any

import torch
from torch import Tensor

from kpred.ops.typing import Float


def affine_influence(
    keypoints: Float[Tensor, "batch keypoints 3"],
    positions: Float[Tensor, "batch positions 3"],
    smoothing: float = 0.01,
    ridge: float = 1e-3,
) -> Float[Tensor, "batch keypoints positions"]:
    """Compute the biharmonic spline (kernel |x|, affine part) from keypoint to position displacements.

    Columns sum to one, and keypoints moved by an affine map move all positions by that map, up to `ridge`, which keeps
    coplanar keypoints solvable. `smoothing` trades interpolation for smoothness. Unit-box frame. Differentiable.
    """
    batch, count, _ = keypoints.shape
    options: dict[str, Any] = {"dtype": torch.float64, "device": keypoints.device}
    source, places = keypoints.double(), positions.double()
    kernel = _distances(source, source) - smoothing * torch.eye(count, **options)
    affine = torch.cat([torch.ones(batch, count, 1, **options), source], dim=2)
    # A ridge on the linear part alone: translations stay exact.
    corner = torch.diag(torch.tensor([0.0, ridge, ridge, ridge], **options)).expand(batch, 4, 4)
    system = torch.cat([torch.cat([kernel, affine], 2), torch.cat([affine.transpose(1, 2), corner], 2)], 1)
    rows = torch.cat([_distances(places, source), torch.ones(batch, places.shape[1], 1, **options), places], dim=2)
    solved = torch.linalg.solve(system, rows.transpose(1, 2))
    return solved[:, :count].to(keypoints.dtype)


def gaussian_influence(
    keypoints: Float[Tensor, "batch keypoints 3"], positions: Float[Tensor, "batch positions 3"], width: float = 0.5
) -> Float[Tensor, "batch keypoints positions"]:
    """Compute normalised Gaussian weights: non-negative columns that sum to one."""
    squared = _distances(keypoints, positions).square()
    return torch.softmax(-squared / (2 * width**2), dim=1)


def _distances(a: Tensor, b: Tensor) -> Tensor:
    # The small constant keeps the gradient of the root finite where points coincide.
    return ((a[:, :, None] - b[:, None]).square().sum(-1) + 1e-12).sqrt()
