"""Nearest neighbours between small clouds, exact, without a distance matrix that outlives the call.

Three paths give the same numbers: compiled CPU kernels (where numba is installed), a fused kernel on CUDA (where Triton
is), and chunked torch, the reference for both.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import lru_cache

import numpy as np
import torch
from torch import Tensor

from kpred.ops.typing import Float, Int

try:
    from kpred.ops.nearest_cpu import nearest_cpu
except ImportError:  # numba is absent on machines that only train
    nearest_cpu = None  # type: ignore[assignment]

CHUNK_ELEMENTS = 1 << 24
"""Largest number of pairwise distances held at once by the torch path."""


def nearest_neighbours(
    query: Float[Tensor, "batch query 3"], reference: Float[Tensor, "batch reference 3"]
) -> tuple[Float[Tensor, "batch query"], Int[Tensor, "batch query"]]:
    """Find squared distance and index of the nearest reference point of every query point (no gradient).

    Both clouds share a frame; the distance is in that frame's units squared. Ties go to the lower index. Clouds of half
    precision, as autocast makes them, are compared in single precision.
    """
    query, reference = _at_least_single(query.detach()), _at_least_single(reference.detach())
    if nearest_cpu is not None and query.device.type == "cpu" and query.dtype == reference.dtype == torch.float32:
        distance, index = (torch.from_numpy(found) for found in nearest_cpu(_array(query), _array(reference)))
        batch = len(query)
        return (distance, index) if len(distance) == batch else (distance.repeat(batch, 1), index.repeat(batch, 1))
    if query.device.type == "cuda" and query.dtype == reference.dtype == torch.float32:
        fused = _fused()
        if fused is not None:
            return fused(query, reference)
    return nearest_reference(query, reference)


@lru_cache(maxsize=1)
def _fused() -> Callable[[Tensor, Tensor], tuple[Tensor, Tensor]] | None:
    """Import the CUDA kernel at first use; None without Triton."""
    try:
        from kpred.ops.nearest_cuda import nearest_cuda
    except ImportError:
        return None
    return nearest_cuda


def _at_least_single(cloud: Tensor) -> Tensor:
    return cloud.float() if cloud.dtype in (torch.float16, torch.bfloat16) else cloud


def _array(clouds: Tensor) -> np.ndarray:
    """Return clouds as an array; a batch that was expanded (stride 0) is returned once."""
    expanded = len(clouds) > 1 and clouds.stride(0) == 0
    array: np.ndarray = (clouds[:1] if expanded else clouds).contiguous().numpy()
    return array


def nearest_reference(
    query: Float[Tensor, "batch query 3"],
    reference: Float[Tensor, "batch reference 3"],
    elements: int = CHUNK_ELEMENTS,
) -> tuple[Float[Tensor, "batch query"], Int[Tensor, "batch query"]]:
    """Find `nearest_neighbours` in plain torch, `elements` pairs at once; on every device and precision."""
    chunk = max(1, elements // (len(query) * reference.shape[1]))
    found = []
    for part in query.split(chunk, dim=1):
        found.append(squared_distance_matrix(part, reference).min(dim=2))
    return torch.cat([f.values for f in found], dim=1), torch.cat([f.indices for f in found], dim=1)


def squared_distance_matrix(a: Float[Tensor, "batch a 3"], b: Float[Tensor, "batch b 3"]) -> Float[Tensor, "batch a b"]:
    """Compute all squared distances by differences, since |a|^2 - 2ab + |b|^2 loses digits."""
    x, y, z = ((a[:, :, None, axis] - b[:, None, :, axis]).square() for axis in range(3))
    return x + y + z
