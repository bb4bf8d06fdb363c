"""Compiled brute-force nearest neighbours for the CPU: sixteen queries at a time, one pass over the reference.

For clouds of a few thousand points this beats a KD-tree (no tree to build for every deformed candidate) and needs no
memory beside its result. `kpred.ops.nearest.nearest_reference` is the plain version that a test holds it equal to.
"""

from __future__ import annotations

from typing import no_type_check

import numba
import numpy as np

LANES = 64


@numba.njit(parallel=True, fastmath={"nnan", "nsz", "contract", "reassoc"}, cache=True)
@no_type_check
def _nearest(query, reference, distance, index):
    batch, count, _ = query.shape
    blocks = (count + LANES - 1) // LANES
    for job in numba.prange(batch * blocks):
        b, start = job // blocks, (job % blocks) * LANES
        qx = np.empty(LANES, np.float32)
        qy = np.empty(LANES, np.float32)
        qz = np.empty(LANES, np.float32)
        best = np.full(LANES, 3.0e38, np.float32)
        where = np.zeros(LANES, np.int32)
        for lane in range(LANES):
            row = min(start + lane, count - 1)
            qx[lane], qy[lane], qz[lane] = query[b, row, 0], query[b, row, 1], query[b, row, 2]
        for j in range(reference.shape[1]):
            rx, ry, rz = reference[b, j, 0], reference[b, j, 1], reference[b, j, 2]
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
    """Squared distances (B, N) float32 and indices (B, N) int64 of the nearest of (B, M, 3) for each of (B, N, 3)."""
    distance = np.empty(query.shape[:2], np.float32)
    index = np.empty(query.shape[:2], np.int64)
    _nearest(query, reference, distance, index)
    return distance, index
