"""Cage refinement compiled for the CPU: all rounds of one cage in one call; cages are shared among threads."""

from __future__ import annotations

from typing import no_type_check

import numba
import numpy as np

from kpred.ops.nearest_cpu import nearest_of_one
from kpred.ops.weighted_sums_cpu import add_wanted, robust_weights

FASTMATH = {"nnan", "nsz", "contract", "reassoc"}
LEAST_PIVOT = 1e-12


def fitted_cage(
    columns: np.ndarray,
    source: np.ndarray,
    start: np.ndarray,
    held: np.ndarray,
    goal: np.ndarray,
    stiff: np.ndarray,
    *,
    rounds: int,
    asked_in_turn: int,
    robust: float,
    least: float,
    partial: bool,
) -> np.ndarray:
    """Displacements (L, 3) of a cage's control points after `rounds` of matches and least squares; unit box, float32.

    Args:
        columns: (N, L) weights of the control points at the source's points; source: (N, 3).
        start: (N, 3) where the first matches are taken, and where points that are not seen stay; held: (N,) with which
            weight.
        goal: (M, 3) of the scan; stiff: (3, L, L) stiffness for x, y and z, float64.
        asked_in_turn: every round asks for so many-th of the points of both sides, the next round for the next.
        robust: squared multiple of the median distance, 0 for equal weights; least: least squared scale.
        partial: whether only the goal's points search.
    """
    arrays = (np.ascontiguousarray(array) for array in (columns.T, source, start, held, goal, stiff))
    return _fitted(*arrays, rounds, asked_in_turn, robust, least, partial)


@numba.njit(cache=True, nogil=True)
@no_type_check
def _fitted(across, source, start, held, goal, stiff, rounds, asked_in_turn, robust, least, partial):
    controls, points = across.shape
    displacement = np.zeros((controls, 3), np.float32)
    wanted = np.empty((points, 4), np.float32)
    factor = np.empty((3, controls, controls))
    # Only the matches of the first round are those of the keypoints' result: the warp begins at the source.
    moved = start.copy()
    for turn in range(rounds):
        match(moved, goal, turn % asked_in_turn, asked_in_turn, robust, least, partial, wanted)
        for i in range(points):
            for axis in range(3):
                wanted[i, axis] += held[i] * start[i, axis]
            wanted[i, 3] += held[i]
        if turn == 0:
            moved = source.copy()
            # Later rounds' normal matrices are close to this.
            normal = _normal(across, wanted)
            for axis in range(3):
                _cholesky(normal, stiff[axis], factor[axis])
        _newton(across, source, wanted, stiff, factor, displacement, moved)
    return displacement


@numba.njit(cache=True, nogil=True)
@no_type_check
def match(moved, goal, turn, asked_in_turn, robust, least, partial, wanted):
    """Fills `wanted` (N, 4): where points `moved` (N, 3) should be, times weight, and the weight.

    By those points of both sides whose turn it is; `fitted_cage` says what the arguments are.
    """
    wanted[:] = 0
    sums = wanted.reshape(1, -1, 4)
    none = np.empty((0, 0), np.int64)
    asked = goal[turn::asked_in_turn].copy()
    squared, index = nearest_of_one(asked, moved)
    add_wanted(sums, asked.reshape(1, -1, 3), _shares(squared, robust, least), index.reshape(1, -1), none)
    if not partial:
        rows = np.arange(turn, len(moved), asked_in_turn).reshape(1, -1)
        squared, index = nearest_of_one(moved[turn::asked_in_turn].copy(), goal)
        add_wanted(sums, goal.reshape(1, -1, 3), _shares(squared, robust, least), rows, index.reshape(1, -1))


@numba.njit(cache=True, nogil=True)
@no_type_check
def _shares(squared, robust, least):
    weight = np.ones((1, len(squared)), np.float32)
    if robust > 0:
        robust_weights(squared.reshape(1, -1), robust, least, weight)
    return weight / np.float32(len(squared))


@numba.njit(cache=True, nogil=True, fastmath=FASTMATH)
@no_type_check
def _normal(across, wanted):
    """Lower half (L, L) of A^T W A."""
    controls, points = across.shape
    normal = np.empty((controls, controls), np.float32)
    weighted = np.empty(points, np.float32)
    for k in range(controls):
        for i in range(points):
            weighted[i] = across[k, i] * wanted[i, 3]
        for j in range(k + 1):
            total = np.float32(0)
            for i in range(points):
                total += weighted[i] * across[j, i]
            normal[k, j] = total
    return normal


@numba.njit(cache=True, nogil=True, fastmath=FASTMATH)
@no_type_check
def _cholesky(normal, stiff, factor):
    """Fills the lower half of `factor` (L, L) with that of normal + stiff, float64.

    The normal matrix is of single precision, which with next to no stiffness may leave a pivot below 0.
    """
    for i in range(len(factor)):
        for j in range(i + 1):
            total = normal[i, j] + stiff[i, j]
            for k in range(j):
                total -= factor[i, k] * factor[j, k]
            factor[i, j] = np.sqrt(max(total, LEAST_PIVOT)) if i == j else total / factor[j, j]


@numba.njit(cache=True, nogil=True, fastmath=FASTMATH)
@no_type_check
def _newton(across, source, wanted, stiff, factor, displacement, moved):
    controls, points = across.shape
    # The columns are what takes long to read: all three axes at once.
    x, y, z = np.empty(points, np.float32), np.empty(points, np.float32), np.empty(points, np.float32)
    pull = np.empty((3, controls))
    for i in range(points):
        weight = wanted[i, 3]
        x[i] = wanted[i, 0] - weight * moved[i, 0]
        y[i] = wanted[i, 1] - weight * moved[i, 1]
        z[i] = wanted[i, 2] - weight * moved[i, 2]
    for k in range(controls):
        along, up, out = np.float32(0), np.float32(0), np.float32(0)
        for i in range(points):
            along += across[k, i] * x[i]
            up += across[k, i] * y[i]
            out += across[k, i] * z[i]
        pull[0, k], pull[1, k], pull[2, k] = along, up, out
    for axis in range(3):
        for k in range(controls):
            held = 0.0
            for j in range(controls):
                held += stiff[axis, k, j] * displacement[j, axis]
            pull[axis, k] -= held
        _solve(factor[axis], pull[axis])
        for k in range(controls):
            displacement[k, axis] += pull[axis, k]
    x[:], y[:], z[:] = source[:, 0], source[:, 1], source[:, 2]
    for k in range(controls):
        along, up, out = displacement[k, 0], displacement[k, 1], displacement[k, 2]
        for i in range(points):
            x[i] += along * across[k, i]
            y[i] += up * across[k, i]
            z[i] += out * across[k, i]
    moved[:, 0], moved[:, 1], moved[:, 2] = x, y, z


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
