"""The structure-keeping fit compiled for the CPU: all rounds of one model in one call.

`tests/twins/structure_reference.py` is the plain version that tests hold this equal to.
"""

from __future__ import annotations

from typing import no_type_check

import numba
import numpy as np

from kpred.refinement.equations_cpu import assemble, solve, stiffen
from kpred.refinement.matching_cpu import hold, match, seen_points
from kpred.refinement.structure_apply_cpu import apply_columns, side_growth
from kpred.refinement.structure_basis import KINDS, RIGID

RELAXATION = 1.7
"""Length of a step beyond what the matches of one round ask for."""

STIFFER = (1e-3, 1e-2, 1e-1, 1.0, 1e2)
"""Weights of second differences that are tried, one after the other, until a spline is monotone."""

FLATTEST = 0.1
"""Least slope of a map along an axis: it is monotone, so that nothing folds."""

SNAP, SNAPPED = 0.03, 1.0
"""Flush ends become flush again if the step between them is smaller than this, unit box; weight of these steps then."""

LINEAR = 0.5
"""Fraction of what is off along an axis that a lean must explain."""


@numba.njit(cache=True, nogil=True)
@no_type_check
def fit_rounds(
    spline, own, bounds, group, boxes, lean_axis, points, across, facing, start, visible, held, goal, stiff, growth,
    limits, spans, slopes, can_lean, can_bend, end_axis, end_inside, end_column, end_factor, flush, feet, floor, rounds,
    robust, minimum, lean_gain, solution, moved,
):  # fmt: skip
    """Fill `solution` (3, U), and `moved` (N, 3), where the points are first matched; points are sorted by part.

    Args:
        spline: (3, K, N), own: (3, 4, N) columns. bounds: (C + 1,) first point of each part; group: (C,).
        boxes: (C, 13) own axes (9), longest first, middle (3), and 1 for parts that are oblique.
        lean_axis: (C, 3); can_lean: (G, 3) 0 for leans that symmetry forbids, 1 for those that need evidence, 2 free;
            can_bend: (G, 3).
        points, start: (N, 3) at the source, and where those that are not seen are held.
        across: (N, 3) weight of a match along each axis; facing: (N,) axis that the surface faces.
        visible: (N,) how surely each was seen; held: (N,) weight of staying at `start`.
        goal: (M, 3); stiff: (3, U, U); growth: (C, 3, U) of each part; limits: (C, 3, 3) lowest and highest growth, and
            the half side that a part's own growth is measured by.
        end_axis, end_inside: (F,), end_column, end_factor: (F, 4) of `InnerEnds`; flush: first weight of flush ends.
        feet: (N,) weight of points that stand on the floor; floor: (N,) height at which it holds each.
        robust: squared multiple of the median distance, 0 for equal weights; minimum: least squared scale.
        lean_gain: gain in weighted squared distance from which a lean is accepted.
    """
    count, controls = points.shape[0], spline.shape[1]
    unknowns = stiff.shape[1]
    wanted = np.empty((count, 4), np.float32)
    normal = np.empty((unknowns, unknowns))
    right = np.empty(unknowns)
    weighted = np.empty(count, np.float32)
    residual = np.empty(count, np.float32)
    leaning = can_lean == 2
    weights = np.where(end_inside == 0.0, flush, 0.0)
    last = last_rounds(rounds)
    seen = seen_points(visible)
    for iteration in range(rounds):
        match(moved, facing, iteration >= last, goal, visible, seen, iteration % 2, robust, minimum, wanted)
        if iteration >= last:
            _snap(end_axis, end_inside, end_column, end_factor, solution, iteration == last, weights)
        hold(wanted, held, start)
        if iteration == rounds // 2:
            _find_leans(own, bounds, group, wanted, moved, can_lean, lean_gain, leaning)
        for axis in range(3):
            for i in range(count):
                weighted[i] = across[i, axis] * wanted[i, 3]
                residual[i] = across[i, axis] * (wanted[i, axis] - wanted[i, 3] * points[i, axis])
                if axis == 1:
                    weighted[i] += feet[i]
                    residual[i] += feet[i] * (floor[i] - points[i, 1])
            assemble(spline[axis], own[axis], bounds, group, weighted, residual, controls, normal, right)
            _constrain(normal, stiff[axis], leaning[:, axis], can_bend[:, axis], controls)
            _tie(normal, right, axis, end_axis, end_inside, end_column, end_factor, weights)
            _solve_monotone(normal, right, spans, axis, slopes, controls)
            # Matches follow a step only in part, so that a longer one converges in fewer rounds.
            ahead = RELAXATION if 0 < iteration < rounds - 2 else 1.0
            for j in range(unknowns):
                solution[axis, j] += ahead * (right[j] - solution[axis, j])
        bound_growth(solution, growth, limits, spans, slopes, group, controls)
        apply_columns(spline, own, bounds, group, boxes, lean_axis, points, solution, growth, limits, moved)


@numba.njit(cache=True, nogil=True)
@no_type_check
def last_rounds(rounds):
    """First of the rounds in which sides are distinguished and ends are snapped."""
    return rounds * 2 // 3


@numba.njit(cache=True, nogil=True)
@no_type_check
def _constrain(normal, stiff, leaning, can_bend, controls):
    """Add stiffness to the lower half of `normal` (U, U); hold leans and bends at 0 unless free."""
    for j in range(len(normal)):
        for k in range(j + 1):
            normal[j, k] += stiff[j, k]
    for g in range(len(leaning)):
        if not leaning[g]:
            normal[controls + KINDS * g + 2, controls + KINDS * g + 2] += RIGID
        if not can_bend[g]:
            normal[controls + KINDS * g + 3, controls + KINDS * g + 3] += RIGID


@numba.njit(cache=True, nogil=True)
@no_type_check
def _tie(normal, right, axis, end_axis, end_inside, end_column, end_factor, weights):
    """Add the squares of steps between tied ends along one axis to the lower half of `normal` (U, U) and `right`."""
    for pair in range(len(end_axis)):
        if end_axis[pair] == axis and weights[pair] > 0:
            for a in range(4):
                pull = weights[pair] * end_factor[pair, a]
                right[end_column[pair, a]] -= pull * end_inside[pair]
                for b in range(4):
                    if end_column[pair, a] >= end_column[pair, b]:
                        normal[end_column[pair, a], end_column[pair, b]] += pull * end_factor[pair, b]


@numba.njit(cache=True, nogil=True)
@no_type_check
def _snap(end_axis, end_inside, end_column, end_factor, solution, first, weights):
    """Set `weights` (F,): ends that have come out of what they touch become flush with it, and stay so.

    In the first of these rounds ends that are flush in the model become flush again if the step between them is small,
    and are set free otherwise.
    """
    for pair in range(len(end_axis)):
        step = end_inside[pair]
        for k in range(4):
            step += end_factor[pair, k] * solution[end_axis[pair], end_column[pair, k]]
        if end_inside[pair] == 0.0:
            if first:
                weights[pair] = SNAPPED if abs(step) < SNAP else 0.0
        elif step * end_factor[pair, 1] > 0:
            weights[pair] = SNAPPED


@numba.njit(cache=True, nogil=True)
@no_type_check
def _solve_monotone(normal, right, spans, axis, slopes, controls):
    """Solve in place for `right` (U,), the spline as stiff as it must be to fold nowhere."""
    before, pull = normal.copy(), right.copy()
    solve(normal, right)
    for smoother in STIFFER:
        if not _folds(right, spans, axis, slopes[axis]):
            break
        # A stiffer spline folds less, and tends to an affine map.
        for j in range(len(right)):
            right[j] = pull[j]
            for k in range(len(right)):
                normal[j, k] = before[j, k]
        stiffen(normal, controls, smoother)
        solve(normal, right)


@numba.njit(cache=True, nogil=True)
@no_type_check
def _find_leans(own, bounds, group, wanted, moved, can_lean, lean_gain, leaning):
    """Mark the leans that alone would lower the weighted squared distance by enough."""
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
def _folds(values, spans, axis, slope):
    """Check whether an increment of the spline's controls is beyond its bounds where it acts on a part as it is."""
    for part in range(len(spans)):
        if spans[part, axis, 0] >= 0:
            for k in range(spans[part, axis, 0], spans[part, axis, 1]):
                step = values[k + 1] - values[k]
                if step < slope[0] or step > slope[1]:
                    return True
    return False


@numba.njit(cache=True, nogil=True)
@no_type_check
def bound_growth(solution, growth, limits, spans, slopes, group, controls):
    """Clip each part's own growth so that its box neither vanishes nor folds."""
    for part in range(len(group)):
        grow = controls + KINDS * group[part] + 1
        for axis in range(3):
            grown = side_growth(growth[part, axis], solution[axis])
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
