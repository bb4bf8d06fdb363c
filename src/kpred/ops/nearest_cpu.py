"""Compiled nearest neighbours for the CPU by brute force: many queries at a time, one pass over the reference.

For clouds of a few hundred points this beats any index and needs no memory beside its result; larger ones go to
`kpred.ops.nearest_blocks`, which says the same to the bit. `kpred.ops.nearest.nearest_reference` is the plain version
that tests hold both equal to.
"""

from __future__ import annotations

from typing import no_type_check

import numba
import numpy as np

from kpred.ops.nearest_blocks import MIN_BLOCK_POINTS, PACK, nearest_blocks, search_sorted, sort_cloud, sort_reference
from kpred.ops.worksharing import parallel_for

LANES = 64


@numba.njit(fastmath={"nnan", "nsz", "contract", "reassoc"}, cache=True, nogil=True)
@no_type_check
def _nearest(query, reference, distance, index, first, last):
    count = query.shape[1]
    blocks = (count + LANES - 1) // LANES
    qx = np.empty(LANES, np.float32)
    qy = np.empty(LANES, np.float32)
    qz = np.empty(LANES, np.float32)
    best = np.empty(LANES, np.float32)
    where = np.empty(LANES, np.int32)
    for job in range(first, last):
        b, start = job // blocks, (job % blocks) * LANES
        # A single cloud stands for all of the batch.
        own = b if len(query) > 1 else 0
        other = b if len(reference) > 1 else 0
        for lane in range(LANES):
            row = min(start + lane, count - 1)
            qx[lane], qy[lane], qz[lane] = query[own, row, 0], query[own, row, 1], query[own, row, 2]
            best[lane] = np.float32(3.0e38)
            where[lane] = 0
        for j in range(reference.shape[1]):
            rx, ry, rz = reference[other, j, 0], reference[other, j, 1], reference[other, j, 2]
            column = np.int32(j)
            for lane in range(LANES):
                dx, dy, dz = qx[lane] - rx, qy[lane] - ry, qz[lane] - rz
                squared = dx * dx + dy * dy + dz * dz
                closer = squared < best[lane]
                best[lane] = squared if closer else best[lane]
                where[lane] = column if closer else where[lane]
        for lane in range(min(LANES, count - start)):
            distance[b, start + lane] = best[lane]
            index[b, start + lane] = where[lane]


def nearest_cpu(query: np.ndarray, reference: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Find squared distances (B, N) float32 and indices (B, N) int64 of the nearest of (B, M, 3).

    Either may be one cloud (1, ..., 3) that stands for all of the batch.
    """
    search = nearest_blocks if min(query.shape[1], reference.shape[1]) >= MIN_BLOCK_POINTS else nearest_brute
    return search(query, reference)


def nearest_brute(query: np.ndarray, reference: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Find as `nearest_cpu`, always without an index."""
    batch, count = max(len(query), len(reference)), query.shape[1]
    distance = np.empty((batch, count), np.float32)
    index = np.empty((batch, count), np.int64)
    jobs = batch * ((count + LANES - 1) // LANES)
    parallel_for(
        lambda first, last: _nearest(query, reference, distance, index, first, last),
        jobs,
        jobs * LANES * reference.shape[1],
    )
    return distance, index


@numba.njit(cache=True, nogil=True)
@no_type_check
def nearest_of_one(query, reference):
    """Find distances and indices (N,) as `nearest_cpu` of one cloud each, for other compiled code."""
    queries, references = query.reshape(1, -1, 3), reference.reshape(1, -1, 3)
    distance = np.empty((1, len(query)), np.float32)
    index = np.empty((1, len(query)), np.int64)
    groups = (len(query) + LANES - 1) // LANES
    if min(len(query), len(reference)) < MIN_BLOCK_POINTS:
        _nearest(queries, references, distance, index, 0, groups)
        return distance[0], index[0]
    packs = -(-len(reference) // PACK)
    points = np.empty((1, 3, packs * PACK), np.float32)
    order = np.empty((1, packs * PACK), np.int32)
    box = np.empty((1, 6, packs), np.float32)
    query_order = np.empty((1, len(query)), np.int32)
    sort_reference(references, points, order, box, 0, 1)
    sort_cloud(query, query_order[0])
    search_sorted(queries, query_order, points, order, box, distance, index, 0, groups)
    return distance[0], index[0]
