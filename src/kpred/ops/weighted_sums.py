"""What least squares between matched clouds sums up: robust weights, wanted places of points, and their products; and
points moved through a deformation basis, which is what is fitted.

Each has two paths that agree within rounding: plain torch (reference, GPU, double precision), and compiled kernels on
the CPU in single precision (`kpred.ops.weighted_sums_cpu`), where small tensors cost torch more than the arithmetic.
"""

from __future__ import annotations

import torch
from torch import Tensor

from kpred.ops.typing import Float, Int

try:
    from kpred.ops import weighted_sums_cpu as compiled
    from kpred.ops.worksharing import parallel_for
except ImportError:  # numba is absent on machines that only train
    compiled = None  # type: ignore[assignment]

MIN_SCALE = 1e-4
"""Added to the squared scale of robust weights, unit box squared: a perfect match has a scale too."""


def robust_weights(squared: Float[Tensor, "batch points"], robust: float) -> Float[Tensor, "batch points"]:
    """Compute Geman-McClure weights of squared distances, scaled by `robust` times the median; 1 when 0.

    The scale is that of each row, so that clean full scans are hardly touched.
    """
    if robust <= 0:
        return torch.ones_like(squared)
    if _is_compiled(squared):
        weight = torch.empty_like(squared)
        compiled.robust_weights(squared.contiguous().numpy(), robust**2, MIN_SCALE, weight.numpy())
        return weight
    return geman_mcclure(squared, robust_scale(squared, robust))


def robust_scale(squared: Float[Tensor, "batch points"], times: float) -> Float[Tensor, "batch 1"]:
    """Return the squared scale of robust weights: `times` the median distance (lower middle), squared."""
    return squared.median(dim=1, keepdim=True).values * times**2 + MIN_SCALE


def geman_mcclure(squared: Tensor, scale: Tensor) -> Tensor:
    """Compute weights in (0, 1] of squared distances, a quarter where they equal the squared scale."""
    return (scale / (scale + squared)).square()


def add_wanted(
    sums: Float[Tensor, "batch points 4"],
    wanted: Float[Tensor, "batch places 3"],
    weight: Float[Tensor, "batch wanted"],
    index: Int[Tensor, "batch wanted"] | None = None,
    picked: Int[Tensor, "batch wanted"] | None = None,
) -> None:
    """Add in place the target positions of points (w p, w) at each index.

    Args:
        sums: of x, y and z times weight, and of the weights; all that is wanted of a point acts as their quotient does.
        wanted: places; those of the rows `picked`, or all of them in their order.
    """
    if _is_compiled(sums, wanted, weight) and sums.is_contiguous():
        rows = wanted[:1] if wanted.stride(0) == 0 else wanted
        none = _NONE.numpy()
        compiled.add_wanted(
            sums.numpy(),
            rows.contiguous().numpy(),
            weight.contiguous().numpy(),
            none if index is None else index.contiguous().numpy(),
            none if picked is None else picked.contiguous().numpy(),
        )
        return
    if picked is not None:
        wanted = wanted.gather(1, picked[..., None].expand(-1, -1, 3))
    weighted = torch.cat([wanted * weight[..., None], weight[..., None]], dim=2)
    if index is None:
        sums += weighted
    else:
        sums.scatter_add_(1, index[..., None].expand(-1, -1, 4), weighted)


def weighted_products(
    across: Float[Tensor, "batch columns points"],
    guess: Float[Tensor, "batch points 3"],
    sums: Float[Tensor, "batch points 4"],
) -> Float[Tensor, "batch columns all"]:
    """Compute normal equations A^T W A and A^T W (wanted - guess), side by side, from columns A^T."""
    if _is_compiled(across, guess, sums):
        found = across.new_empty(len(across), across.shape[1], across.shape[1] + 3)
        arrays = (part.contiguous().numpy() for part in (across, guess, sums))
        compiled.weighted_products(*arrays, found.numpy())
        return found
    weight = sums[..., 3:]
    residual = sums[..., :3] - weight * guess
    return across @ torch.cat([weight * across.transpose(1, 2), residual], dim=2)


def deformed(
    points: Float[Tensor, "batch points 3"],
    basis: Float[Tensor, "batch points keypoints"],
    displacement: Float[Tensor, "batch keypoints 3"],
) -> Float[Tensor, "batch points 3"]:
    """Compute S + B d: points moved by keypoint displacements through a deformation basis."""
    if not _is_compiled(points, basis, displacement) or displacement.requires_grad:
        return points + basis @ displacement
    moved = torch.empty_like(points, memory_format=torch.contiguous_format)
    arrays = [part.contiguous().numpy() for part in (points, basis, displacement)]
    steps = basis.numel() * 3
    parallel_for(lambda first, last: compiled.deform(*arrays, moved.numpy(), first, last), len(points), steps)
    return moved


_NONE = torch.empty(0, 0, dtype=torch.long)


def _is_compiled(*parts: Tensor) -> bool:
    return compiled is not None and all(part.device.type == "cpu" and part.dtype == torch.float32 for part in parts)
