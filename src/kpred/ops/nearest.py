"""Nearest neighbours between small clouds, exact, without a distance matrix that outlives the call.

Two paths give the same numbers: a compiled CPU kernel (where numba is installed) and chunked torch (reference, GPU).
"""

from __future__ import annotations

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
    """Squared distance and index of the nearest reference point for every query point (no gradient).

    Both clouds share a frame; the distance is in that frame's units squared. Ties go to the lower index.
    """
    query, reference = query.detach(), reference.detach()
    if nearest_cpu is not None and query.device.type == "cpu" and query.dtype == torch.float32:
        distance, index = nearest_cpu(query.contiguous().numpy(), reference.contiguous().numpy())
        return torch.from_numpy(distance), torch.from_numpy(index)
    return nearest_reference(query, reference)


def nearest_reference(
    query: Float[Tensor, "batch query 3"], reference: Float[Tensor, "batch reference 3"]
) -> tuple[Float[Tensor, "batch query"], Int[Tensor, "batch query"]]:
    """`nearest_neighbours` in plain torch, by chunks of the query; runs on every device and precision."""
    chunk = max(1, CHUNK_ELEMENTS // (len(query) * reference.shape[1]))
    found = []
    for part in query.split(chunk, dim=1):
        found.append(squared_distance_matrix(part, reference).min(dim=2))
    return torch.cat([f.values for f in found], dim=1), torch.cat([f.indices for f in found], dim=1)


def squared_distance_matrix(a: Float[Tensor, "batch a 3"], b: Float[Tensor, "batch b 3"]) -> Float[Tensor, "batch a b"]:
    """All squared distances, by differences: |a|^2 - 2ab + |b|^2 would lose half the digits of near neighbours."""
    x, y, z = ((a[:, :, None, axis] - b[:, None, :, axis]).square() for axis in range(3))
    return x + y + z
