"""Normal equations of one axis, compiled for the CPU: assembled from columns, stiffened, solved."""

from __future__ import annotations

from typing import no_type_check

import numba
import numpy as np

from kpred.refinement.structure_basis import KINDS

FASTMATH = {"nnan", "nsz", "contract", "reassoc"}
MIN_PIVOT = 1e-12

BLOCK = 256
"""Points whose columns stay in the cache while they are multiplied with one another."""


@numba.njit(cache=True, nogil=True)
@no_type_check
def assemble(spline, own, bounds, group, weight, residual, controls, normal, right):
    """Fill the lower half of `normal` (U, U) and `right` (U,) with A^T W A and A^T r."""
    normal[:] = 0.0
    right[:] = 0.0
    _add_spline(spline, weight, residual, normal, right)
    scaled = np.empty((KINDS, spline.shape[1]), np.float32)
    for part in range(len(bounds) - 1):
        first, last = bounds[part], bounds[part + 1]
        if last > first:
            _add_part(spline, own, weight, residual, first, last, scaled, controls + KINDS * group[part], normal, right)


@numba.njit(cache=True, nogil=True, fastmath=FASTMATH)
@no_type_check
def _add_spline(spline, weight, residual, normal, right):
    """Add products of the spline's columns (K, N) with one another, some points at a time: they stay in the cache."""
    controls, count = spline.shape
    scaled = np.empty(BLOCK, np.float32)
    product, pull = np.zeros((controls, controls), np.float32), np.zeros(controls, np.float32)
    for start in range(0, count, BLOCK):
        end = min(start + BLOCK, count)
        for k in range(controls):
            column = spline[k, start:end]
            _multiply(column, weight[start:end], scaled)
            pull[k] += _dot(column, residual[start:end])
            for j in range(k + 1):
                product[k, j] += _dot(spline[j, start:end], scaled)
    for k in range(controls):
        right[k] += pull[k]
        for j in range(k + 1):
            normal[k, j] += product[k, j]


@numba.njit(cache=True, nogil=True, fastmath=FASTMATH)
@no_type_check
def _add_part(spline, own, weight, residual, first, last, scaled, row, normal, right):
    """Add products of one part's own columns (4, N) with one another and with the spline's (K, N), from `row` on."""
    for kind in range(KINDS):
        _multiply(own[kind, first:last], weight[first:last], scaled[kind])
        right[row + kind] += _dot(own[kind, first:last], residual[first:last])
        for k in range(len(spline)):
            normal[row + kind, k] += _dot(spline[k, first:last], scaled[kind])
        for other in range(kind + 1):
            normal[row + kind, row + other] += _dot(own[other, first:last], scaled[kind])


# Sums and products over slices in functions of their own: only so does the compiler know that they do not overlap, and
# a loop that both stored and summed would add in another order where memory lies otherwise.
@numba.njit(cache=True, nogil=True, fastmath=FASTMATH)
@no_type_check
def _multiply(left, right, product):
    """Fill `product` (at least N,) with left (N,) times right (N,)."""
    for i in range(len(left)):
        product[i] = left[i] * right[i]


@numba.njit(cache=True, nogil=True, fastmath=FASTMATH)
@no_type_check
def _dot(left, right):
    """Sum the products of left (N,) and right (at least N,)."""
    total = np.float32(0)
    for i in range(len(left)):
        total += left[i] * right[i]
    return total


@numba.njit(cache=True, nogil=True, fastmath=FASTMATH)
@no_type_check
def solve(normal, right):
    """Solves with the lower half of `normal`, by Cholesky's factor, in place."""
    count = len(right)
    for i in range(count):
        for j in range(i + 1):
            total = normal[i, j]
            for k in range(j):
                total -= normal[i, k] * normal[j, k]
            normal[i, j] = np.sqrt(max(total, MIN_PIVOT)) if i == j else total / normal[j, j]
    for i in range(count):
        total = right[i]
        for k in range(i):
            total -= normal[i, k] * right[k]
        right[i] = total / normal[i, i]
    for i in range(count - 1, -1, -1):
        right[i] /= normal[i, i]
        for k in range(i):
            right[k] -= normal[i, k] * right[i]


@numba.njit(cache=True, nogil=True)
@no_type_check
def stiffen(normal, controls, weight):
    """Add the square of second differences of the spline's controls to the lower half of `normal`."""
    for k in range(controls - 2):
        for i in range(3):
            for j in range(i + 1):
                sign = -2.0 if i == 1 or j == 1 else 1.0
                normal[k + i, k + j] += weight * (4.0 if i == 1 and j == 1 else sign)
