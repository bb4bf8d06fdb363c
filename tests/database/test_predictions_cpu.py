"""Compiled predictions are those of the plain loops, and come off again."""

import numpy as np
import pytest

from kpred.database.predictions_cpu import WINDOW, add_predictions, remove_predictions


def _plain(cells: np.ndarray, numbers: np.ndarray) -> np.ndarray:
    """Differences (N, K) by Python's own whole numbers, which cannot overflow."""
    differences = numbers.astype(object)
    for row in range(1, len(numbers)):
        before = range(row - 1, max(-1, row - 1 - WINDOW), -1)
        distances = [(sum(int(d) ** 2 for d in cells[row] - cells[other]), -other) for other in before]
        nearest = [(distance, -other) for distance, other in sorted(distances)[:2]]
        weights = [2**20 // (1 + 256 * distance // (nearest[0][0] + 1)) for distance, _ in nearest]
        for column in range(numbers.shape[1]):
            parts = zip(weights, nearest, strict=True)
            total = sum(weight * int(numbers[other, column]) for weight, (_, other) in parts)
            differences[row, column] -= (2 * total + sum(weights)) // (2 * sum(weights))
    return differences.astype(np.int64)


@pytest.mark.parametrize(("side", "bits"), [(4, 16), (2**15, 16), (2**15, 32)])
def test_as_the_plain_loops_and_back(side: int, bits: int) -> None:
    rng = np.random.default_rng(bits)
    cells = rng.integers(0, side, (2 * WINDOW, 3))
    numbers = rng.integers(-(2 ** (bits - 1)), 2 ** (bits - 1), (2 * WINDOW, 3))
    differences = np.empty_like(numbers)
    remove_predictions(cells, numbers, differences)
    np.testing.assert_array_equal(differences, _plain(cells, numbers))
    wrapped = differences.astype(f"<i{bits // 8}").astype(np.int64)
    add_predictions(cells, wrapped, bits)
    np.testing.assert_array_equal(wrapped, numbers)
