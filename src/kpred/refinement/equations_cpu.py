"""Normal equations of one axis, compiled for the CPU: assembled from columns, stiffened, solved."""

from __future__ import annotations

from typing import no_type_check

import numba
import numpy as np

from kpred.refinement.structure_basis import KINDS

FASTMATH = {"nnan", "nsz", "contract", "reassoc"}
MIN_PIVOT = 1e-12


@numba.njit(cache=True, nogil=True, fastmath=FASTMATH)
@no_type_check
def assemble(spline, own, bounds, group, weight, residual, controls, normal, right):
    """Fills the lower half of `normal` (U, U) and `right` (U,) with A^T W A and A^T r."""
    count = spline.shape[1]
    normal[:] = 0.0
    right[:] = 0.0
    scaled = np.empty(count, np.float32)
    for k in range(controls):
        # Sums apart from stores: one loop of both would add in another order where memory lies otherwise.
        for i in range(count):
            scaled[i] = spline[k, i] * weight[i]
        total = np.float32(0)
        for i in range(count):
            total += spline[k, i] * residual[i]
        right[k] = total
        for j in range(k + 1):
            product = np.float32(0)
            for i in range(count):
                product += scaled[i] * spline[j, i]
            normal[k, j] = product
        for part in range(len(bounds) - 1):
            for kind in range(KINDS):
                product = np.float32(0)
                for i in range(bounds[part], bounds[part + 1]):
                    product += scaled[i] * own[kind, i]
                normal[controls + KINDS * group[part] + kind, k] += product
    for part in range(len(bounds) - 1):
        first = controls + KINDS * group[part]
        for kind in range(KINDS):
            for i in range(bounds[part], bounds[part + 1]):
                scaled[i] = own[kind, i] * weight[i]
            total = np.float32(0)
            for i in range(bounds[part], bounds[part + 1]):
                total += own[kind, i] * residual[i]
            right[first + kind] += total
            for other in range(kind + 1):
                product = np.float32(0)
                for i in range(bounds[part], bounds[part + 1]):
                    product += scaled[i] * own[other, i]
                normal[first + kind, first + other] += product


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
    """Adds the square of second differences of the spline's controls to the lower half of `normal`."""
    for k in range(controls - 2):
        for i in range(3):
            for j in range(i + 1):
                sign = -2.0 if i == 1 or j == 1 else 1.0
                normal[k + i, k + j] += weight * (4.0 if i == 1 and j == 1 else sign)
