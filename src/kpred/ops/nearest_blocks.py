"""Compiled exact nearest neighbours for larger clouds: blocks of nearby points, most of which need not be looked at.

Both clouds are sorted along a space-filling curve, so that consecutive points are close. Queries are searched many at a
time; a block of the reference is skipped where its box is farther from the queries' box than what was found already.
Every bound is on the safe side, so that strays and points far outside cost time but never exactness, and distances are
those of the brute force to the bit; of equally near points the lower index is taken, as there.
"""

from __future__ import annotations

from typing import no_type_check

import numba
import numpy as np

from kpred.ops.worksharing import parallel_for

LANES = 32
"""Queries at a time."""

PACK = 16
"""Points in a block of the reference."""

CELLS = 16
"""Cells along the longest side of a cloud, by which it is sorted."""

MIN_BLOCK_POINTS = 768
"""Points in either cloud from which on sorting pays (measured)."""

FAR = np.float32(3.0e38)
FASTMATH = {"nnan", "nsz", "contract", "reassoc"}


def _curve() -> np.ndarray:
    """Rank of each cell along Hilbert's curve, (CELLS**3,) int32, by Skilling's transform of its coordinates."""
    axes = np.stack(np.meshgrid(*[np.arange(CELLS)] * 3, indexing="ij")).reshape(3, -1)
    bits = CELLS.bit_length() - 1
    for bit in range(bits - 1, 0, -1):
        low = (1 << bit) - 1
        for axis in range(3):
            swapped = (axes[0] ^ axes[axis]) & low
            high = (axes[axis] >> bit) & 1 == 1
            axes[0] = np.where(high, axes[0] ^ low, axes[0] ^ swapped)
            axes[axis] = np.where(high, axes[axis], axes[axis] ^ swapped)
    axes[1] ^= axes[0]
    axes[2] ^= axes[1]
    flip = np.zeros_like(axes[0])
    for bit in range(bits - 1, 0, -1):
        flip = np.where((axes[2] >> bit) & 1 == 1, flip ^ ((1 << bit) - 1), flip)
    axes ^= flip
    rank = np.zeros_like(axes[0])
    for bit in range(bits - 1, -1, -1):
        for axis in range(3):
            rank = rank << 1 | (axes[axis] >> bit) & 1
    return rank.astype(np.int32)


CURVE = _curve()


@numba.njit(cache=True, nogil=True)
@no_type_check
def _cell(offset, scale):
    # Written so that NaN ends in a cell too.
    place = offset * scale
    if not place > 0:
        return 0
    return CELLS - 1 if place >= CELLS - 1 else int(place)


@numba.njit(cache=True, nogil=True)
@no_type_check
def sort_cloud(cloud, order):
    """Fill `order` with the rows of one cloud along the curve, rows of one cell in their order."""
    lowest, highest = cloud[0].copy(), cloud[0].copy()
    for i in range(len(cloud)):
        for axis in range(3):
            value = cloud[i, axis]
            if value < lowest[axis]:
                lowest[axis] = value
            if value > highest[axis]:
                highest[axis] = value
    side = max(highest[0] - lowest[0], highest[1] - lowest[1], highest[2] - lowest[2])
    scale = np.float32(CELLS) / side if side > 0 else np.float32(0)
    rank = np.empty(len(cloud), np.int32)
    start = np.zeros(CELLS**3 + 1, np.int32)
    for i in range(len(cloud)):
        x = _cell(cloud[i, 0] - lowest[0], scale)
        y = _cell(cloud[i, 1] - lowest[1], scale)
        z = _cell(cloud[i, 2] - lowest[2], scale)
        rank[i] = CURVE[(x * CELLS + y) * CELLS + z]
        start[rank[i] + 1] += 1
    total = 0
    for k in range(CELLS**3 + 1):
        total += start[k]
        start[k] = total
    for i in range(len(cloud)):
        order[start[rank[i]]] = i
        start[rank[i]] += 1


@numba.njit(cache=True, nogil=True)
@no_type_check
def sort_reference(reference, sorted_points, order, box, first, last):
    """Sort clouds, repeating the last point to fill the last block; also return each block's box."""
    count, blocks = reference.shape[1], box.shape[2]
    for b in range(first, last):
        sort_cloud(reference[b], order[b])
        for i in range(count, blocks * PACK):
            order[b, i] = order[b, count - 1]
        for axis in range(3):
            for j in range(blocks):
                low = high = reference[b, order[b, j * PACK], axis]
                for i in range(j * PACK, (j + 1) * PACK):
                    value = reference[b, order[b, i], axis]
                    sorted_points[b, axis, i] = value
                    low = value if value < low else low
                    high = value if value > high else high
                box[b, axis, j], box[b, 3 + axis, j] = low, high


@numba.njit(cache=True, nogil=True)
@no_type_check
def _sort_all(clouds, order, first, last):
    for b in range(first, last):
        sort_cloud(clouds[b], order[b])


@numba.njit(fastmath=FASTMATH)
@no_type_check
def squared(x, y, z):
    """Return the squared length of a vector."""
    return x * x + y * y + z * z


@numba.njit(fastmath=FASTMATH)
@no_type_check
def _nearer(squared, row, best, where):
    """Return the nearer of two points, the lower row of equally near ones."""
    closer = (squared < best) | ((squared == best) & (row < where))
    return squared if closer else best, row if closer else where


@numba.njit(cache=True, nogil=True, fastmath=FASTMATH)
@no_type_check
def _look(block, qx, qy, qz, best, where, points, order):
    """Compare the queries with one block and return their largest distance."""
    # Four points a pass: what is known of the queries is then loaded and stored a quarter as often.
    for p in range(block * PACK, (block + 1) * PACK, 4):
        ax, ay, az, a = points[0, p], points[1, p], points[2, p], order[p]
        bx, by, bz, b = points[0, p + 1], points[1, p + 1], points[2, p + 1], order[p + 1]
        cx, cy, cz, c = points[0, p + 2], points[1, p + 2], points[2, p + 2], order[p + 2]
        dx, dy, dz, d = points[0, p + 3], points[1, p + 3], points[2, p + 3], order[p + 3]
        for lane in range(LANES):
            x, y, z, near, row = qx[lane], qy[lane], qz[lane], best[lane], where[lane]
            near, row = _nearer(squared(x - ax, y - ay, z - az), a, near, row)
            near, row = _nearer(squared(x - bx, y - by, z - bz), b, near, row)
            near, row = _nearer(squared(x - cx, y - cy, z - cz), c, near, row)
            near, row = _nearer(squared(x - dx, y - dy, z - dz), d, near, row)
            best[lane], where[lane] = near, row
    worst = np.float32(0)
    for lane in range(LANES):
        worst = best[lane] if best[lane] > worst else worst
    return worst


@numba.njit(cache=True, nogil=True, fastmath=FASTMATH)
@no_type_check
def _bounds(box, qx, qy, qz, bound):
    """Compute the squared distance of each block's box from the queries' box, rounded down."""
    lx, ly, lz = qx[0], qy[0], qz[0]
    hx, hy, hz = qx[0], qy[0], qz[0]
    for lane in range(1, LANES):
        lx, hx = min(lx, qx[lane]), max(hx, qx[lane])
        ly, hy = min(ly, qy[lane]), max(hy, qy[lane])
        lz, hz = min(lz, qz[lane]), max(hz, qz[lane])
    zero = np.float32(0)
    for j in range(len(bound)):
        above, below = box[0, j] - hx, lx - box[3, j]
        dx = above if above > below else below
        above, below = box[1, j] - hy, ly - box[4, j]
        dy = above if above > below else below
        above, below = box[2, j] - hz, lz - box[5, j]
        dz = above if above > below else below
        dx = dx if dx > zero else zero
        dy = dy if dy > zero else zero
        dz = dz if dz > zero else zero
        bound[j] = (dx * dx + dy * dy + dz * dz) * np.float32(0.99999)


@numba.njit(cache=True, nogil=True, fastmath=FASTMATH)
@no_type_check
def search_sorted(query, query_order, sorted_points, order, box, distance, index, first, last):
    """Fill `distance` and `index` for groups `first` to `last` of sorted queries."""
    count, blocks = query.shape[1], box.shape[2]
    groups = (count + LANES - 1) // LANES
    qx = np.empty(LANES, np.float32)
    qy = np.empty(LANES, np.float32)
    qz = np.empty(LANES, np.float32)
    best = np.empty(LANES, np.float32)
    where = np.empty(LANES, np.int32)
    bound = np.empty(blocks, np.float32)
    for job in range(first, last):
        b, start = job // groups, (job % groups) * LANES
        # A single cloud stands for all of the batch.
        own = b if len(query) > 1 else 0
        other = b if len(sorted_points) > 1 else 0
        points, rows = sorted_points[other], order[other]
        for lane in range(LANES):
            row = query_order[own, min(start + lane, count - 1)]
            qx[lane], qy[lane], qz[lane] = query[own, row, 0], query[own, row, 1], query[own, row, 2]
            best[lane] = FAR
            where[lane] = 0
        _bounds(box[other], qx, qy, qz, bound)
        nearest = 0
        for j in range(blocks):
            if bound[j] < bound[nearest]:
                nearest = j
        worst = _look(nearest, qx, qy, qz, best, where, points, rows)
        bound[nearest] = np.inf
        # The nearer ones first: after them fewer of the others are within reach.
        for fraction in (np.float32(0.25), np.float32(1.0)):
            for j in range(blocks):
                if bound[j] <= fraction * worst:
                    worst = _look(j, qx, qy, qz, best, where, points, rows)
                    bound[j] = np.inf
        for lane in range(min(LANES, count - start)):
            row = query_order[own, start + lane]
            distance[b, row] = best[lane]
            index[b, row] = where[lane]


def nearest_blocks(query: np.ndarray, reference: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Find squared distances and indices (B, N) of the nearest of (B, M, 3) to (B, N, 3), by blocks.

    Either may be one cloud (1, ..., 3) that stands for all of the batch; it is sorted once.
    """
    batch, count = max(len(query), len(reference)), query.shape[1]
    clouds, size = reference.shape[:2]
    blocks = -(-size // PACK)
    points = np.empty((clouds, 3, blocks * PACK), np.float32)
    order = np.empty((clouds, blocks * PACK), np.int32)
    box = np.empty((clouds, 6, blocks), np.float32)
    query_order = np.empty(query.shape[:2], np.int32)
    # Sorting a point costs about as much as twenty distances.
    parallel_for(
        lambda first, last: sort_reference(reference, points, order, box, first, last), clouds, 20 * clouds * size
    )
    parallel_for(lambda first, last: _sort_all(query, query_order, first, last), len(query), 20 * query_order.size)
    distance = np.empty((batch, count), np.float32)
    index = np.empty((batch, count), np.int64)
    jobs = batch * -(-count // LANES)
    parallel_for(
        lambda first, last: search_sorted(query, query_order, points, order, box, distance, index, first, last),
        jobs,
        jobs * LANES * size // 2,
    )
    return distance, index
