"""Numbers of points predicted from near points before them, compiled for the CPU, in whole numbers alone.

Rounding differs between processors, and one wrong unit would spoil all points after it; whole numbers do not.
"""

from __future__ import annotations

from typing import no_type_check

import numba
import numpy as np

WINDOW = 128
"""Points before a point among which its two nearest are looked for."""


@numba.njit(cache=True, nogil=True)
@no_type_check
def remove_predictions(cells, numbers, differences):
    """Write numbers (N, K) less their predictions into `differences`, all int64; `cells` (N, 3) int64: places."""
    guess = np.zeros(numbers.shape[1], np.int64)
    for row in range(len(numbers)):
        _predict(cells, numbers, row, guess)
        for column in range(len(guess)):
            differences[row, column] = numbers[row, column] - guess[column]


@numba.njit(cache=True, nogil=True)
@no_type_check
def add_predictions(cells, numbers, bits):
    """Undo `remove_predictions` in place, for numbers that wrap around at `bits` bits as signed integers."""
    guess = np.zeros(numbers.shape[1], np.int64)
    half, mask = np.int64(1) << (bits - 1), (np.int64(1) << bits) - 1
    for row in range(len(numbers)):
        _predict(cells, numbers, row, guess)
        for column in range(len(guess)):
            numbers[row, column] = ((numbers[row, column] + guess[column] + half) & mask) - half


@numba.njit(cache=True, nogil=True)
@no_type_check
def _predict(cells, numbers, row, guess):
    """Predict row `row`: the mean of its two nearest among `WINDOW` rows before it, the later of equally near ones.

    The second one weighs less the farther it is in comparison with the first.
    """
    first, second, near, far = -1, -1, np.int64(0), np.int64(0)
    for other in range(row - 1, max(-1, row - 1 - WINDOW), -1):
        distance = np.int64(0)
        for axis in range(3):
            distance += (cells[row, axis] - cells[other, axis]) ** 2
        if first < 0 or distance < near:
            second, far = first, near
            first, near = other, distance
        elif second < 0 or distance < far:
            second, far = other, distance
    if first < 0:
        guess[:] = 0
        return
    one = (np.int64(1) << 20) // (1 + 256 * near // (near + 1))
    two = (np.int64(1) << 20) // (1 + 256 * far // (near + 1)) if second >= 0 else np.int64(0)
    both = one + two
    for column in range(len(guess)):
        total = one * numbers[first, column] + (two * numbers[second, column] if second >= 0 else np.int64(0))
        guess[column] = (2 * total + both) // (2 * both)
