"""The structure-keeping fit compiled for the CPU: all rounds of one model in one call.

`kpred.refinement.structure_reference` is the plain version that tests hold this equal to.
"""

from __future__ import annotations

from typing import no_type_check

import numba
import numpy as np

from kpred.ops.nearest_cpu import nearest_of_one
from kpred.ops.weighted_sums_cpu import ranked

FASTMATH = {"nnan", "nsz", "contract", "reassoc"}
KINDS = 4
"""Unknowns of each group along an axis: move, grow, lean, bend."""

RIGID = 1e3
"""Weight that holds an unknown at 0."""

RELAXATION = 2.0
"""Length of a step beyond what the matches of one round ask for."""

STIFFER = (1e-3, 1e-2, 1e-1, 1.0, 1e2)
"""Weights of second differences that are tried, one after the other, until a spline is monotone."""

FLATTEST = 0.1
"""Least slope of a map along an axis: it is monotone, so that nothing folds."""

MIN_PIVOT = 1e-12
LINEAR = 0.5
"""Fraction of what is off along an axis that a lean must explain."""

SEEN = 0.3
"""Surface less visible than this is no match for a point of the scan."""


@numba.njit(cache=True, nogil=True)
@no_type_check
def fit_rounds(
    spline, own, bounds, group, boxes, lean_axis, points, start, visible, held, goal, stiff, growth, limits, spans, slopes, can_lean, can_bend,
    feet, floor, rounds, robust, minimum, lean_gain, solution, moved,
):  # fmt: skip
    """Fills `solution` (3, U) and `moved` (N, 3); points are sorted by part.

    Args:
        spline: (3, K, N), own: (3, 4, N) columns. bounds: (C + 1,) first point of each part; group: (C,).
        boxes: (C, 13) own axes (9), longest first, middle (3), and 1 for parts that are oblique.
        lean_axis: (C, 3); can_lean: (G, 3) 0 for leans that symmetry forbids, 1 for those that need evidence, 2 free;
            can_bend: (G, 3).
        points, start: (N, 3) at the source, and where the first matches are taken.
        visible: (N,) how surely each was seen; held: (N,) weight of staying at `start`.
        goal: (M, 3); stiff: (3, U, U); growth: (C, 3, U) of each part; limits: (C, 3, 3) lowest and highest growth, and
            the half side that a part's own growth is measured by.
        feet: (N,) weight of points that stand on the floor; floor: its height.
        robust: squared multiple of the median distance, 0 for equal weights; minimum: least squared scale.
        lean_gain: gain in weighted squared distance from which a lean is accepted.
    """
    count, controls = points.shape[0], spline.shape[1]
    unknowns, groups = stiff.shape[1], can_lean.shape[0]
    wanted = np.empty((count, 4), np.float32)
    normal = np.empty((unknowns, unknowns))
    right = np.empty(unknowns)
    before, pull = np.empty((unknowns, unknowns)), np.empty(unknowns)
    weighted = np.empty(count, np.float32)
    residual = np.empty(count, np.float32)
    leaning = can_lean == 2
    seen = np.flatnonzero(visible >= SEEN)
    if len(seen) < 8:
        seen = np.arange(count)
    moved[:] = start
    for turn in range(rounds):
        match(moved, goal, visible, seen, turn % 2, robust, minimum, wanted)
        for i in range(count):
            for axis in range(3):
                wanted[i, axis] += held[i] * start[i, axis]
            wanted[i, 3] += held[i]
        if turn == rounds // 2:
            _find_leans(own, bounds, group, wanted, moved, can_lean, lean_gain, leaning)
        for axis in range(3):
            for i in range(count):
                weighted[i] = wanted[i, 3]
                residual[i] = wanted[i, axis] - wanted[i, 3] * points[i, axis]
                if axis == 1:
                    weighted[i] += feet[i]
                    residual[i] += feet[i] * (floor - points[i, 1])
            _assemble(spline[axis], own[axis], bounds, group, weighted, residual, controls, normal, right)
            for j in range(unknowns):
                for k in range(j + 1):
                    normal[j, k] += stiff[axis, j, k]
            for g in range(groups):
                if not leaning[g, axis]:
                    normal[controls + KINDS * g + 2, controls + KINDS * g + 2] += RIGID
                if not can_bend[g, axis]:
                    normal[controls + KINDS * g + 3, controls + KINDS * g + 3] += RIGID
            before[:], pull[:] = normal, right
            _solve(normal, right)
            for smoother in STIFFER:
                if not _folds(right, spans, axis, slopes[axis]):
                    break
                # A stiffer spline folds less, and tends to an affine map.
                normal[:], right[:] = before, pull
                _stiffen(normal, controls, smoother)
                _solve(normal, right)
            # Matches follow a step only in part, so that a longer one converges in fewer rounds.
            ahead = RELAXATION if 0 < turn < rounds - 2 else 1.0
            for j in range(unknowns):
                solution[axis, j] += ahead * (right[j] - solution[axis, j])
        _bound(solution, growth, limits, spans, slopes, group, controls)
        apply_columns(spline, own, bounds, group, boxes, lean_axis, points, solution, growth, limits, moved)


@numba.njit(cache=True, nogil=True)
@no_type_check
def _find_leans(own, bounds, group, wanted, moved, can_lean, lean_gain, leaning):
    """Marks the leans that alone would lower the weighted squared distance by enough."""
    for axis in range(3):
        pull, hold, off = np.zeros(len(leaning)), np.zeros(len(leaning)), np.zeros(len(leaning))
        for part in range(len(group)):
            g = group[part]
            for i in range(bounds[part], bounds[part + 1]):
                residual = wanted[i, axis] - wanted[i, 3] * moved[i, axis]
                pull[g] += own[axis, 2, i] * residual
                off[g] += residual * residual / max(wanted[i, 3], np.float32(1e-9))
                hold[g] += own[axis, 2, i] * own[axis, 2, i] * wanted[i, 3]
        for g in range(len(leaning)):
            gain = pull[g] * pull[g] / max(hold[g], 1e-12)
            if can_lean[g, axis] == 1 and gain > lean_gain and gain > LINEAR * off[g]:
                leaning[g, axis] = True


@numba.njit(cache=True, nogil=True)
@no_type_check
def match(moved, goal, visible, seen, first, robust, minimum, wanted):
    """Fills `wanted` (N, 4): where points should be, times weight, and the weight; both ways."""
    wanted[:] = 0
    asked = goal[first::2].copy()
    targets = moved[seen].copy() if len(seen) < len(moved) else moved
    squared, index = nearest_of_one(asked, targets)
    scale = np.float32(ranked(squared.copy(), (len(squared) - 1) // 2) * robust + minimum)
    for i in range(len(asked)):
        w = np.float32(1.0 / len(asked))
        if robust > 0:
            ratio = scale / (scale + squared[i])
            w *= ratio * ratio
        row = seen[index[i]] if len(seen) < len(moved) else index[i]
        for axis in range(3):
            wanted[row, axis] += w * asked[i, axis]
        wanted[row, 3] += w
    some = moved[first::2].copy()
    squared, index = nearest_of_one(some, goal)
    scale = np.float32(ranked(squared.copy(), (len(squared) - 1) // 2) * robust + minimum)
    for i in range(len(some)):
        row = first + 2 * i
        w = np.float32(visible[row] / len(some))
        if robust > 0:
            ratio = scale / (scale + squared[i])
            w *= ratio * ratio
        for axis in range(3):
            wanted[row, axis] += w * goal[index[i], axis]
        wanted[row, 3] += w


@numba.njit(cache=True, nogil=True, fastmath=FASTMATH)
@no_type_check
def _assemble(spline, own, bounds, group, weight, residual, controls, normal, right):
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
def _solve(normal, right):
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
def _folds(values, spans, axis, slope):
    """Whether an increment of the spline's controls is beyond its bounds where it acts on a part as it is."""
    for part in range(len(spans)):
        if spans[part, axis, 0] >= 0:
            for k in range(spans[part, axis, 0], spans[part, axis, 1]):
                step = values[k + 1] - values[k]
                if step < slope[0] or step > slope[1]:
                    return True
    return False


@numba.njit(cache=True, nogil=True)
@no_type_check
def _stiffen(normal, controls, weight):
    """Adds the square of second differences of the spline's controls to the lower half of `normal`."""
    for k in range(controls - 2):
        for i in range(3):
            for j in range(i + 1):
                sign = -2.0 if i == 1 or j == 1 else 1.0
                normal[k + i, k + j] += weight * (4.0 if i == 1 and j == 1 else sign)


@numba.njit(cache=True, nogil=True)
@no_type_check
def _bound(solution, growth, limits, spans, slopes, group, controls):
    """Clips each part's own growth so that its box neither vanishes nor turns inside out, nor folds anywhere in it."""
    for part in range(len(group)):
        grow = controls + KINDS * group[part] + 1
        for axis in range(3):
            grown = _growth(growth[part, axis], solution[axis])
            if grown < limits[part, axis, 0]:
                solution[axis, grow] += (limits[part, axis, 0] - grown) / 2
            elif grown > limits[part, axis, 1]:
                solution[axis, grow] += (limits[part, axis, 1] - grown) / 2
            if spans[part, axis, 0] >= 0:
                least = 1e30
                for k in range(spans[part, axis, 0], spans[part, axis, 1]):
                    least = min(least, solution[axis, k + 1] - solution[axis, k])
                # Slope of the spline and of the part's own growth together, in units of the bound.
                spacing = slopes[axis, 2]
                slope = least / spacing + solution[axis, grow] / limits[part, axis, 2]
                if slope < FLATTEST - 1.0:
                    solution[axis, grow] += (FLATTEST - 1.0 - slope) * limits[part, axis, 2]


@numba.njit(cache=True, nogil=True)
@no_type_check
def _growth(row, solution):
    total = 0.0
    for j in range(len(solution)):
        total += row[j] * solution[j]
    return total


@numba.njit(cache=True, nogil=True, fastmath=FASTMATH)
@no_type_check
def apply_columns(spline, own, bounds, group, boxes, lean_axis, points, solution, growth, limits, moved):
    """Fills `moved` (N, 3) with where `solution` takes the points; see `fit_rounds`."""
    count, controls = points.shape[0], spline.shape[1]
    along = np.empty(count, np.float32)
    for axis in range(3):
        along[:] = points[:, axis]
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
            i = bounds[part]
            # Sign of a mirrored part's lean: that of its column.
            place = (points[i, lean_axis[part, axis]] - boxes[part, 9 + lean_axis[part, axis]])
            sign = 1.0 if own[axis, 2, i] * place >= 0 else -1.0
            lean[axis] = sign * solution[axis, controls + KINDS * group[part] + 2] / limits[part, lean_axis[part, axis], 2]
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
    """Rotates and scales a part along its own axes, where axis maps and lean alone would shear it."""
    factor = np.empty(3)
    matrix = np.zeros((3, 3))
    for axis in range(3):
        factor[axis] = 1.0 + _growth(growth[part, axis], solution[axis]) / (2.0 * limits[part, axis, 2])
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
    oblique = boxes[part, 12] > 0
    for axis in range(3):
        middle[axis] = boxes[part, 9 + axis]
        # The middle of an affine part goes where the axis maps take it; that of another one is the mean of its ends.
        place[axis] = moved[first, axis] - factor[axis] * (points[first, axis] - middle[axis])
    if not oblique:
        for axis in range(3):
            place[axis] = 0.0
            for i in range(first, last):
                place[axis] += moved[i, axis] - factor[axis] * (points[i, axis] - middle[axis])
            place[axis] /= last - first
    for i in range(first, last):
        local = np.zeros(3)
        for k in range(3):
            for axis in range(3):
                if oblique:
                    local[k] += (points[i, axis] - middle[axis]) * boxes[part, 3 * k + axis]
                else:
                    # What the axis map makes of the coordinate, in units of the source.
                    local[k] += (moved[i, axis] - place[axis]) / factor[axis] * boxes[part, 3 * k + axis]
        for axis in range(3):
            moved[i, axis] = place[axis] + local[0] * image[0, axis] + local[1] * image[1, axis] + local[2] * image[2, axis]
