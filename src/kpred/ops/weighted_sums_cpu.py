"""Compiled kernels of `kpred.ops.weighted_sums`, single precision; candidates are few and their tensors small."""

from __future__ import annotations

from typing import no_type_check

import numba
import numpy as np

FASTMATH = {"nnan", "nsz", "contract", "reassoc"}


@numba.njit(cache=True, nogil=True, fastmath=FASTMATH)
@no_type_check
def robust_weights(squared, times, min_scale, weight):
    """Fill `weight` (B, N) from `squared` (B, N); `times`: of the median; `min_scale`: added to the scale."""
    middle = (squared.shape[1] - 1) // 2
    for b in range(len(squared)):
        scale = np.float32(ranked(squared[b].copy(), middle) * times + min_scale)
        for i in range(squared.shape[1]):
            factor = scale / (scale + squared[b, i])
            weight[b, i] = factor * factor


@numba.njit(cache=True, nogil=True)
@no_type_check
def ranked(values, rank):
    """Return the value of a rank, counted from 0 (Hoare's selection); reorders `values`."""
    low, high = 0, len(values) - 1
    while low < high:
        pivot = values[(low + high) // 2]
        i, j = low, high
        while i <= j:
            while values[i] < pivot:
                i += 1
            while pivot < values[j]:
                j -= 1
            if i <= j:
                values[i], values[j] = values[j], values[i]
                i += 1
                j -= 1
        if rank <= j:
            high = j
        elif rank >= i:
            low = i
        else:
            break
    return values[rank]


@numba.njit(cache=True, nogil=True)
@no_type_check
def add_wanted(sums, wanted, weight, index, picked):
    """Add (w p, w) to `sums` (B, N, 4); empty `index` and `picked` mean all rows in order."""
    for b in range(len(weight)):
        own = b if len(wanted) > 1 else 0
        for i in range(weight.shape[1]):
            row = index[b, i] if len(index) else i
            place = picked[b, i] if len(picked) else i
            w = weight[b, i]
            for axis in range(3):
                sums[b, row, axis] += w * wanted[own, place, axis]
            sums[b, row, 3] += w


@numba.njit(cache=True, nogil=True, fastmath=FASTMATH)
@no_type_check
def weighted_products(across, guess, sums, found):
    """Fill `found` (B, E, E + 3) from `across` (B, E, N), `guess` (B, N, 3), `sums` (B, N, 4)."""
    batch, columns, points = across.shape
    weighted = np.empty(points, np.float32)
    residual = np.empty((3, points), np.float32)
    for b in range(batch):
        for i in range(points):
            for axis in range(3):
                residual[axis, i] = sums[b, i, axis] - sums[b, i, 3] * guess[b, i, axis]
        for e in range(columns):
            for i in range(points):
                weighted[i] = across[b, e, i] * sums[b, i, 3]
            for f in range(e, columns):
                total = np.float32(0)
                for i in range(points):
                    total += weighted[i] * across[b, f, i]
                found[b, e, f] = total
                found[b, f, e] = total
            for axis in range(3):
                total = np.float32(0)
                for i in range(points):
                    total += across[b, e, i] * residual[axis, i]
                found[b, e, columns + axis] = total


@numba.njit(cache=True, nogil=True, fastmath=FASTMATH)
@no_type_check
def deform(points, basis, displacement, moved, first, last):
    """Fill `moved` with points (B, N, 3) + basis (B, N, K) @ displacement (B, K, 3), for a part of the batch."""
    for b in range(first, last):
        for i in range(points.shape[1]):
            x, y, z = points[b, i, 0], points[b, i, 1], points[b, i, 2]
            for k in range(basis.shape[2]):
                factor = basis[b, i, k]
                x += factor * displacement[b, k, 0]
                y += factor * displacement[b, k, 1]
                z += factor * displacement[b, k, 2]
            moved[b, i, 0], moved[b, i, 1], moved[b, i, 2] = x, y, z
