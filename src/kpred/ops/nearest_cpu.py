"""Compiled nearest neighbours for the CPU by brute force: many queries at a time, one pass over the reference.

For clouds of a few hundred points this beats any index and needs no memory beside its result; larger ones go to
`kpred.ops.nearest_blocks`, which says the same to the bit. `kpred.ops.nearest.nearest_reference` is the plain version
that tests hold both equal to.
"""

from __future__ import annotations

from typing import no_type_check

import numba
import numpy as np

from kpred.ops.nearest_blocks import (
    FASTMATH,
    MIN_BLOCK_POINTS,
    PACK,
    nearest_blocks,
    search_sorted,
    sort_cloud,
    sort_reference,
    squared,
)
from kpred.ops.nearest_blocks import LANES as SORTED_LANES
from kpred.ops.worksharing import parallel_for

LANES = 64
"""Queries at a time."""


@numba.njit(fastmath=FASTMATH)
@no_type_check
def _nearer(length, row, best, where):
    """Return the nearer of two points; of equally near ones the first."""
    closer = length < best
    return length if closer else best, row if closer else where


@numba.njit(fastmath=FASTMATH, cache=True, nogil=True)
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
        cloud, start = job // blocks, (job % blocks) * LANES
        # A single cloud stands for all of the batch.
        own = cloud if len(query) > 1 else 0
        other = cloud if len(reference) > 1 else 0
        for lane in range(LANES):
            row = min(start + lane, count - 1)
            qx[lane], qy[lane], qz[lane] = query[own, row, 0], query[own, row, 1], query[own, row, 2]
            best[lane] = np.float32(3.0e38)
            where[lane] = 0
        points = reference[other]
        whole = len(points) - len(points) % 4
        # Four points a pass: what is known of the queries is then loaded and stored a quarter as often.
        for j in range(0, whole, 4):
            ax, ay, az, a = points[j, 0], points[j, 1], points[j, 2], np.int32(j)
            bx, by, bz, b = points[j + 1, 0], points[j + 1, 1], points[j + 1, 2], np.int32(j + 1)
            cx, cy, cz, c = points[j + 2, 0], points[j + 2, 1], points[j + 2, 2], np.int32(j + 2)
            dx, dy, dz, d = points[j + 3, 0], points[j + 3, 1], points[j + 3, 2], np.int32(j + 3)
            for lane in range(LANES):
                x, y, z, near, row = qx[lane], qy[lane], qz[lane], best[lane], where[lane]
                near, row = _nearer(squared(x - ax, y - ay, z - az), a, near, row)
                near, row = _nearer(squared(x - bx, y - by, z - bz), b, near, row)
                near, row = _nearer(squared(x - cx, y - cy, z - cz), c, near, row)
                near, row = _nearer(squared(x - dx, y - dy, z - dz), d, near, row)
                best[lane], where[lane] = near, row
        for j in range(whole, len(points)):
            ax, ay, az, a = points[j, 0], points[j, 1], points[j, 2], np.int32(j)
            for lane in range(LANES):
                length = squared(qx[lane] - ax, qy[lane] - ay, qz[lane] - az)
                best[lane], where[lane] = _nearer(length, a, best[lane], where[lane])
        for lane in range(min(LANES, count - start)):
            distance[cloud, start + lane] = best[lane]
            index[cloud, start + lane] = where[lane]


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
    search_sorted(queries, query_order, points, order, box, distance, index, 0, -(-len(query) // SORTED_LANES))
    return distance[0], index[0]
