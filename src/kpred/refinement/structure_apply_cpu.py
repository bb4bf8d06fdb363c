"""Moving points by a solution, compiled for the CPU: axis maps, parts, leans that become rotations, bends."""

from __future__ import annotations

from typing import no_type_check

import numba
import numpy as np

from kpred.refinement.structure_basis import KINDS

FASTMATH = {"nnan", "nsz", "contract", "reassoc"}


@numba.njit(cache=True, nogil=True, fastmath=FASTMATH)
@no_type_check
def apply_columns(spline, own, bounds, group, boxes, lean_axis, points, solution, growth, limits, moved):
    """Fill `moved` (N, 3) with where `solution` takes the points; see `fit_rounds`."""
    count, controls = points.shape[0], spline.shape[1]
    along = np.empty(count, np.float32)
    for axis in range(3):
        for i in range(count):
            along[i] = points[i, axis]
        for k in range(controls):
            value = np.float32(solution[axis, k])
            for i in range(count):
                along[i] += value * spline[axis, k, i]
        for part in range(len(bounds) - 1):
            first = controls + KINDS * group[part]
            shift, stretch = np.float32(solution[axis, first]), np.float32(solution[axis, first + 1])
            for i in range(bounds[part], bounds[part + 1]):
                along[i] += shift * own[axis, 0, i] + stretch * own[axis, 1, i]
        for i in range(count):
            moved[i, axis] = along[i]
    lean = np.empty(3)
    for part in range(len(bounds) - 1):
        if bounds[part + 1] == bounds[part]:
            continue
        most = 0.0
        for axis in range(3):
            along_lean = lean_axis[part, axis]
            # A mirrored part's lean has the sign of its column.
            same = 0.0
            for i in range(bounds[part], bounds[part + 1]):
                same += own[axis, 2, i] * (points[i, along_lean] - boxes[part, 9 + along_lean])
            sign = 1.0 if same >= 0 else -1.0
            lean[axis] = sign * solution[axis, controls + KINDS * group[part] + 2] / limits[part, along_lean, 2]
            most = max(most, abs(lean[axis]))
        if boxes[part, 12] > 0 or most > 1e-4:
            _square(part, bounds, boxes, lean_axis, points, solution, growth, limits, lean, moved)
        for axis in range(3):
            bend = solution[axis, controls + KINDS * group[part] + 3]
            if abs(bend) > 1e-6:
                for i in range(bounds[part], bounds[part + 1]):
                    moved[i, axis] += bend * own[axis, 3, i]


@numba.njit(cache=True, nogil=True)
@no_type_check
def _square(part, bounds, boxes, lean_axis, points, solution, growth, limits, lean, moved):
    """Rotates and scales an affinely mapped part along its own axes, where axis maps and lean alone would shear it."""
    factor = np.empty(3)
    matrix = np.zeros((3, 3))
    for axis in range(3):
        factor[axis] = 1.0 + side_growth(growth[part, axis], solution[axis]) / (2.0 * limits[part, axis, 2])
        matrix[axis, axis] = factor[axis]
        matrix[axis, lean_axis[part, axis]] += lean[axis]
    image = np.zeros((3, 3))
    for k in range(3):
        for axis in range(3):
            for other in range(3):
                image[k, axis] += matrix[axis, other] * boxes[part, 3 * k + other]
        for before in range(k):
            dot, length = 0.0, 0.0
            for axis in range(3):
                dot += image[k, axis] * image[before, axis]
                length += image[before, axis] * image[before, axis]
            for axis in range(3):
                image[k, axis] -= dot / length * image[before, axis]
    first, last = bounds[part], bounds[part + 1]
    middle, place = np.empty(3), np.empty(3)
    for axis in range(3):
        middle[axis] = boxes[part, 9 + axis]
        # Such a part is mapped affinely: from any point it follows where its middle goes.
        place[axis] = moved[first, axis] - factor[axis] * (points[first, axis] - middle[axis])
    for i in range(first, last):
        local = np.zeros(3)
        for k in range(3):
            for axis in range(3):
                local[k] += (points[i, axis] - middle[axis]) * boxes[part, 3 * k + axis]
        for axis in range(3):
            moved[i, axis] = (
                place[axis] + local[0] * image[0, axis] + local[1] * image[1, axis] + local[2] * image[2, axis]
            )


@numba.njit(cache=True, nogil=True)
@no_type_check
def side_growth(row, solution):
    """Growth of one side of a part: the product of its row and the unknowns."""
    total = 0.0
    for j in range(len(solution)):
        total += row[j] * solution[j]
    return total
