"""One fused kernel for nearest neighbours on CUDA: distances are never written to memory.

The plain path writes and reads each of its distances some ten times; here a program holds a tile of them in registers,
with the least one of each lane, and takes the least of the lanes at the end.
"""

from __future__ import annotations

from typing import no_type_check

import torch
import triton
import triton.language as tl
from torch import Tensor

QUERIES, REFERENCES = 64, 32
"""Tile: so many queries of one program, compared with so many reference points at a time."""


@triton.jit
@no_type_check
def _nearest(
    query, reference, distance, index, queries, references, query_stride, reference_stride,
    ROWS: tl.constexpr, COLUMNS: tl.constexpr,
):  # fmt: skip
    batch = tl.program_id(1).to(tl.int64)
    row = tl.program_id(0) * ROWS + tl.arange(0, ROWS)
    column = tl.arange(0, COLUMNS)
    place = query + batch * query_stride + row * 3
    inside = row < queries
    qx = tl.load(place, mask=inside, other=0.0)[:, None]
    qy = tl.load(place + 1, mask=inside, other=0.0)[:, None]
    qz = tl.load(place + 2, mask=inside, other=0.0)[:, None]
    best = tl.full((ROWS, COLUMNS), float("inf"), tl.float32)
    where = tl.zeros((ROWS, COLUMNS), tl.int32)
    start = reference + batch * reference_stride
    for first in range(0, references, COLUMNS):
        at = first + column
        there = at < references
        dx = qx - tl.load(start + at * 3, mask=there, other=float("inf"))[None, :]
        dy = qy - tl.load(start + at * 3 + 1, mask=there, other=0.0)[None, :]
        dz = qz - tl.load(start + at * 3 + 2, mask=there, other=0.0)[None, :]
        squared = dx * dx + dy * dy + dz * dz
        # Only a smaller one takes the place: of equals the first stays.
        closer = squared < best
        best = tl.where(closer, squared, best)
        where = tl.where(closer, at[None, :], where)
    least = tl.min(best, axis=1)
    found = tl.min(tl.where(best == least[:, None], where, 2147483647), axis=1)
    out = batch * queries + row
    tl.store(distance + out, least, mask=inside)
    tl.store(index + out, found.to(tl.int64), mask=inside)


def nearest_cuda(query: Tensor, reference: Tensor) -> tuple[Tensor, Tensor]:
    """Find squared distances and indices (B, N) of the nearest of (B, M, 3), single precision, on CUDA.

    Either may be expanded to the batch. Distances equal the plain path's up to the rounding of fused multiplications.
    """
    query, reference = _dense(query), _dense(reference)
    batch, queries, references = max(len(query), len(reference)), query.shape[1], reference.shape[1]
    distance = torch.empty(batch, queries, device=query.device)
    index = torch.empty(batch, queries, dtype=torch.int64, device=query.device)
    grid = (triton.cdiv(queries, QUERIES), batch)
    if batch and queries:
        _nearest[grid](
            query,
            reference,
            distance,
            index,
            queries,
            references,
            query.stride(0) if len(query) > 1 else 0,
            reference.stride(0) if len(reference) > 1 else 0,
            QUERIES,
            REFERENCES,
        )
    return distance, index


def _dense(clouds: Tensor) -> Tensor:
    """Return contiguous clouds; those of a batch may share memory."""
    return clouds if clouds.stride()[1:] == (3, 1) else clouds.contiguous()
