"""The choice of a few models that together explain shapes."""

from __future__ import annotations

from itertools import combinations

import numpy as np
from choose_models import choose_columns


def explained(errors: np.ndarray, weights: np.ndarray, chosen: list[int]) -> float:
    """Weighted best and second best errors together."""
    two = np.sort(np.concatenate([errors[:, chosen], np.full((len(errors), 2), -3.0)], axis=1), axis=1)[:, :2]
    return float(weights @ two.sum(axis=1))


def test_the_choice_is_close_to_the_best_of_all() -> None:
    rng = np.random.default_rng(0)
    errors, weights = rng.uniform(-7, -4, (30, 9)), np.full(30, 1 / 30)
    best = min(explained(errors, weights, list(some)) for some in combinations(range(9), 4))
    found = explained(errors, weights, choose_columns(errors, weights, 4))
    worst = max(explained(errors, weights, list(some)) for some in combinations(range(9), 4))
    # Greedy choices of such sums gain at least 1 - 1/e of what the best gains.
    assert found <= worst + (1 - 1 / np.e) * (best - worst)


def test_a_model_that_alone_explains_a_rare_shape_is_chosen() -> None:
    errors = np.full((10, 6), -5.0)
    errors[9, 3] = -8.0
    assert 3 in choose_columns(errors, np.full(10, 0.1), 3)


def test_no_more_are_chosen_than_there_are() -> None:
    assert sorted(choose_columns(np.full((4, 3), -5.0), np.full(4, 0.25), 10)) == [0, 1, 2]
