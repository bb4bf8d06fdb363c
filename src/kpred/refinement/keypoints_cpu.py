"""Keypoint refinement compiled for the CPU: all rounds of one candidate in one call, candidates on all threads.

What `kpred.refinement.keypoints` does in plain torch, where no sensor is known. Tensors are so small there that torch
spends most of the time between its operations.
"""

from __future__ import annotations

from typing import no_type_check

import numba
import numpy as np

from kpred.ops.nearest_cpu import nearest_of_one
from kpred.ops.weighted_sums_cpu import add_wanted, ranked, robust_weights, weighted_products
from kpred.ops.worksharing import parallel_for


def columns_and_guess(
    points: np.ndarray, basis: np.ndarray, network: np.ndarray, step: int
) -> tuple[np.ndarray, np.ndarray]:
    """Compute `across` (C, K, n) and `guess` (C, n, 3) of `refine_compiled`, of every `step`-th point.

    Args:
        points: (C, N, 3); basis: (C, N, K); network: (C, K, 3) displacements of the keypoints; float32, unit box.
    """
    count = -(-points.shape[1] // step)
    across = np.empty((len(points), basis.shape[2], count), np.float32)
    guess = np.empty((len(points), count, 3), np.float32)
    parallel_for(
        lambda first, last: _columns(points, basis, network, step, across, guess, first, last),
        len(points),
        3 * across.size,
    )
    return across, guess


@numba.njit(cache=True, nogil=True, fastmath={"nnan", "nsz", "contract", "reassoc"})
@no_type_check
def _columns(points, basis, network, step, across, guess, first, last):
    for c in range(first, last):
        for i in range(guess.shape[1]):
            x, y, z = points[c, i * step, 0], points[c, i * step, 1], points[c, i * step, 2]
            for k in range(basis.shape[2]):
                weight = basis[c, i * step, k]
                across[c, k, i] = weight
                x += weight * network[c, k, 0]
                y += weight * network[c, k, 1]
                z += weight * network[c, k, 2]
            guess[c, i, 0], guess[c, i, 1], guess[c, i, 2] = x, y, z


def refine_compiled(
    across: np.ndarray,
    guess: np.ndarray,
    goal: np.ndarray,
    mirrored: np.ndarray,
    likely: np.ndarray,
    held: np.ndarray,
    hold: np.ndarray,
    correction: np.ndarray,
    *,
    rounds: int,
    stride: int,
    robust: tuple[float, float, float],
    prior: float,
    partial: bool,
) -> np.ndarray:
    """Improve corrections of the keypoints in place, float32, unit box, and return `Refined.error`, (C,).

    Args:
        across: (C, K, N) transposed deformation basis; guess: (C, N, 3) points without correction.
        goal: (1 or C, M, 3) the scan; mirrored: (R, 3) its mirror image, likely: (R,) how much each counts.
        held: (C, K, K) what holds the corrections, beside the prior; hold: (C, K) how much the prior holds each.
        correction: (C, K, 3) of the start, and of the result.
        rounds: `RefineConfig.iterations`; stride: `kpred.refinement.keypoints.QUERY_STRIDE`.
        robust: squared multiples of the median distance for the scan's points (0: all count the same) and for mirrored
            ones, and the least squared scale.
        prior: weight, as a fraction of the mean diagonal; partial: whether only the scan's points query.
    """
    error = np.empty(len(guess), np.float32)

    def some(first: int, last: int) -> None:
        _refine(
            across, guess, goal, mirrored, likely, held, hold, correction,
            rounds, stride, robust, prior, partial, error, first, last,
        )  # fmt: skip

    parallel_for(some, len(guess), len(guess) * rounds * guess.shape[1] * goal.shape[1] // stride)
    return error


@numba.njit(cache=True, nogil=True, fastmath={"nnan", "nsz", "contract", "reassoc"})
@no_type_check
def _refine(
    across, guess, goal, mirrored, likely, held, hold, correction,
    rounds, stride, robust, prior, partial, error, first, last,
):  # fmt: skip
    count, points, images = across.shape[1], guess.shape[1], len(mirrored)
    moved = np.empty((points, 3), np.float32)
    sums = np.empty((1, points, 4), np.float32)
    products = np.empty((1, count, count + 3), np.float32)
    for c in range(first, last):
        scan = goal[c if len(goal) > 1 else 0]
        for step in range(rounds):
            _move(across[c], guess[c], correction[c], moved)
            offset = step % stride
            sums[:] = 0
            queries = scan[offset::stride]
            size = len(queries)
            searched = np.empty((size + images, 3), np.float32)
            searched[:size] = queries
            searched[size:] = mirrored
            squared, index = nearest_of_one(searched, moved)
            error[c] = squared[:size].mean()
            weight = np.empty((1, size + images), np.float32)
            _weigh(squared, size, robust, likely, weight[0])
            add_wanted(sums, searched.reshape(1, size + images, 3), weight, index.reshape(1, -1), _none())
            if not partial:
                rows = np.arange(offset, points, stride)
                squared, index = nearest_of_one(moved[offset::stride].copy(), scan)
                error[c] += squared.mean()
                weight = np.empty((1, len(rows)), np.float32)
                _weigh(squared, len(rows), robust, likely[:0], weight[0])
                add_wanted(sums, scan.reshape(1, -1, 3), weight, rows.reshape(1, -1), index.reshape(1, -1))
            weighted_products(across[c : c + 1], guess[c : c + 1], sums, products)
            _solve(products[0], held[c], hold[c], prior, correction[c])


@numba.njit(cache=True, nogil=True)
@no_type_check
def _none():
    return np.empty((0, 0), np.int64)


@numba.njit(cache=True, nogil=True, fastmath={"nnan", "nsz", "contract", "reassoc"})
@no_type_check
def _move(across, guess, correction, moved):
    points = guess.shape[0]
    along = np.empty(points, np.float32)
    for axis in range(3):
        along[:] = guess[:, axis]
        for k in range(len(across)):
            shift = correction[k, axis]
            for i in range(points):
                along[i] += shift * across[k, i]
        moved[:, axis] = along


@numba.njit(cache=True, nogil=True)
@no_type_check
def _weigh(squared, size, robust, likely, weight):
    """Weights of `size` points, which add up to about 1, and of their mirror images behind them."""
    multiple, stray, least = robust
    scan = squared[:size].reshape(1, -1)
    of_scan = np.empty((1, size), np.float32)
    if multiple > 0:
        robust_weights(scan, multiple, least, of_scan)
    else:
        of_scan[:] = 1
    for i in range(size):
        weight[i] = of_scan[0, i] / size
    if len(likely):
        # The scale of mirrored points is by the median of the scan's.
        scale = np.float32(ranked(scan[0].copy(), (size - 1) // 2) * stray + least)
        for i in range(len(likely)):
            ratio = scale / (scale + squared[size + i])
            weight[size + i] = likely[i] * ratio * ratio


@numba.njit(cache=True, nogil=True)
@no_type_check
def _solve(products, held, hold, prior, correction):
    """Least squares by Cholesky's factors in double precision; `correction` (K, 3) is what is found."""
    count = len(held)
    level = 0.0
    for k in range(count):
        level += products[k, k] / count
    factor = np.zeros((count, count))
    for i in range(count):
        for j in range(i + 1):
            value = np.float64(products[i, j]) + held[i, j]
            if i == j:
                value += prior * level * hold[i]
            for k in range(j):
                value -= factor[i, k] * factor[j, k]
            factor[i, j] = np.sqrt(max(value, 1e-12)) if i == j else value / factor[j, j]
    for axis in range(3):
        found = np.empty(count)
        for i in range(count):
            value = np.float64(products[i, count + axis])
            for k in range(i):
                value -= factor[i, k] * found[k]
            found[i] = value / factor[i, i]
        for i in range(count - 1, -1, -1):
            value = found[i]
            for k in range(i + 1, count):
                value -= factor[k, i] * found[k]
            found[i] = value / factor[i, i]
            correction[i, axis] = found[i]
