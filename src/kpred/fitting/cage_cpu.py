"""Rounds of cage refinement compiled for the CPU; cages are shared among threads."""

from __future__ import annotations

from typing import no_type_check

import numba
import numpy as np

from kpred.ops.nearest_cpu import nearest_of_one
from kpred.ops.weighted_sums_cpu import add_wanted, robust_weights
from kpred.ops.worksharing import share_out

FASTMATH = {"nnan", "nsz", "contract", "reassoc"}


def match(
    moved: np.ndarray, goal: np.ndarray, turn: int, asked_in_turn: int, robust: float, least: float, partial: bool
) -> np.ndarray:
    """Where points are wanted, times weight, and the weight, (C, N, 4), by those points of both sides whose turn it is.

    Args:
        moved: (C, N, 3); goal: (M, 3); float32, unit box.
        turn, asked_in_turn: the first row that is asked, and the step to the next ones.
        robust: squared multiple of the median distance, 0 for equal weights; least: least squared scale.
        partial: whether only the goal's points search.
    """
    sums = np.zeros((*moved.shape[:2], 4), np.float32)
    share_out(
        lambda first, last: _match(moved, goal, turn, asked_in_turn, robust, least, partial, sums, first, last),
        len(moved),
        len(moved) * moved.shape[1] * len(goal) // asked_in_turn,
    )
    return sums


@numba.njit(cache=True, nogil=True)
@no_type_check
def _match(moved, goal, turn, asked_in_turn, robust, least, partial, sums, first, last):
    asked = goal[turn::asked_in_turn].copy()
    rows = np.arange(turn, moved.shape[1], asked_in_turn).reshape(1, -1)
    none = np.empty((0, 0), np.int64)
    for c in range(first, last):
        squared, index = nearest_of_one(asked, moved[c])
        weight = _shares(squared, robust, least)
        add_wanted(sums[c : c + 1], asked.reshape(1, -1, 3), weight, index.reshape(1, -1), none)
        if not partial:
            squared, index = nearest_of_one(moved[c, turn::asked_in_turn].copy(), goal)
            weight = _shares(squared, robust, least)
            add_wanted(sums[c : c + 1], goal.reshape(1, -1, 3), weight, rows, index.reshape(1, -1))


@numba.njit(cache=True, nogil=True)
@no_type_check
def _shares(squared, robust, least):
    weight = np.ones((1, len(squared)), np.float32)
    if robust > 0:
        robust_weights(squared.reshape(1, -1), robust, least, weight)
    return weight / np.float32(len(squared))


def newton_rounds(
    across: np.ndarray,
    few: np.ndarray,
    start: np.ndarray,
    held: np.ndarray,
    goal: np.ndarray,
    wanted: np.ndarray,
    stiff: np.ndarray,
    factor: np.ndarray,
    *,
    rounds: int,
    asked_in_turn: int,
    robust: float,
    least: float,
    partial: bool,
) -> np.ndarray:
    """Displacements (C, L, 3) of the control points after `rounds` of least squares, with new matches between them.

    Args:
        across: (C, L, N) transposed weights of the control points; few: (C, N, 3) the source.
        start: (C, N, 3) where points that are not seen stay, held: (C, N) with which weight.
        goal: (M, 3) of the scan; wanted: (C, N, 4), that of the first round: `match` and what is held.
        stiff: (3, L, L) stiffness for x, y and z, float64.
        factor: (C, 3, L, L) lower triangular, float64, of the first round's normal matrix: later rounds' are close.
        asked_in_turn, robust, least, partial: as for `match`.
    """
    displacement = np.zeros((len(few), across.shape[1], 3), np.float32)
    share_out(
        lambda first, last: _rounds(
            across,
            few,
            start,
            held,
            goal,
            wanted,
            stiff,
            factor,
            rounds,
            asked_in_turn,
            robust,
            least,
            partial,
            displacement,
            first,
            last,
        ),  # fmt: skip
        len(few),
        len(few) * rounds * few.shape[1] * len(goal) // asked_in_turn,
    )
    return displacement


@numba.njit(cache=True, nogil=True)
@no_type_check
def _rounds(
    across, few, start, held, goal, wanted, stiff, factor,
    rounds, asked_in_turn, robust, least, partial, displacement, first, last,
):  # fmt: skip
    for c in range(first, last):
        one = slice(c, c + 1)
        # Only the matches of the first round are those of the keypoints' result: the warp begins at the source.
        moved, sums = few[one].copy(), wanted[one].copy()
        for turn in range(rounds):
            if turn > 0:
                sums[:] = 0
                _match(moved, goal, turn % asked_in_turn, asked_in_turn, robust, least, partial, sums, 0, 1)
                for i in range(few.shape[1]):
                    for axis in range(3):
                        sums[0, i, axis] += held[c, i] * start[c, i, axis]
                    sums[0, i, 3] += held[c, i]
            _newton(across[one], few[one], moved, sums, stiff, factor[one], displacement[one], moved, 0, 1)


@numba.njit(cache=True, nogil=True, fastmath=FASTMATH)
@no_type_check
def _newton(across, few, now, wanted, stiff, factor, displacement, moved, first, last):
    controls, points = across.shape[1:]
    residual = np.empty(points, np.float32)
    pull = np.empty(controls)
    for c in range(first, last):
        for axis in range(3):
            for i in range(points):
                residual[i] = wanted[c, i, axis] - wanted[c, i, 3] * now[c, i, axis]
            for k in range(controls):
                total = np.float32(0)
                for i in range(points):
                    total += across[c, k, i] * residual[i]
                held = 0.0
                for j in range(controls):
                    held += stiff[axis, k, j] * displacement[c, j, axis]
                pull[k] = total - held
            _solve(factor[c, axis], pull)
            for k in range(controls):
                displacement[c, k, axis] += pull[k]
            residual[:] = few[c, :, axis]
            for k in range(controls):
                shift = displacement[c, k, axis]
                for i in range(points):
                    residual[i] += shift * across[c, k, i]
            moved[c, :, axis] = residual


@numba.njit(cache=True, nogil=True, fastmath=FASTMATH)
@no_type_check
def _solve(factor, right):
    """Solves L L^T x = right in place."""
    count = len(right)
    for i in range(count):
        total = right[i]
        for k in range(i):
            total -= factor[i, k] * right[k]
        right[i] = total / factor[i, i]
    for i in range(count - 1, -1, -1):
        right[i] /= factor[i, i]
        for k in range(i):
            right[k] -= factor[i, k] * right[i]
