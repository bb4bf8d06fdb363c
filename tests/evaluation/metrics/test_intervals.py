"""Intervals: they hold the estimate, cover the truth as often as they say, and are the same for the same seed."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from kpred.evaluation.metrics.intervals import fraction_interval, mean_interval, median_interval, ratio_interval

VALUES = st.lists(st.floats(0, 100), min_size=2, max_size=30)


@given(VALUES)
def test_the_mean_and_its_interval_lie_among_the_values(values: list[float]) -> None:
    found = mean_interval(values, seed=0)
    assert found.low is not None
    assert found.high is not None
    assert found.value == pytest.approx(np.mean(values))
    assert min(values) - 1e-9 <= found.low <= found.high <= max(values) + 1e-9
    assert found == mean_interval(values, seed=0)


def test_the_interval_of_a_mean_covers_the_truth_as_often_as_it_says() -> None:
    rng = np.random.default_rng(0)
    hits = 0
    for trial in range(300):
        found = mean_interval(rng.exponential(size=40).tolist(), seed=trial)
        assert found.low is not None
        assert found.high is not None
        hits += found.low <= 1.0 <= found.high
    # A bootstrap of 40 skewed values covers a little less than 95 %.
    assert 0.88 <= hits / 300 <= 0.98


def test_another_seed_moves_the_interval_but_not_the_mean() -> None:
    values = np.random.default_rng(1).normal(size=30).tolist()
    one, two = mean_interval(values, 0), mean_interval(values, 1)
    assert one.value == two.value
    assert one.low != two.low


def test_pairs_are_drawn_together() -> None:
    below = np.random.default_rng(0).lognormal(0, 2, size=50)
    found = ratio_interval((1.5 * below).tolist(), below.tolist(), seed=0)
    assert [found.value, found.low, found.high] == pytest.approx([1.5] * 3)
    with pytest.raises(ValueError, match="pairs"):
        ratio_interval([1.0, 2.0], [1.0], seed=0)


def test_a_ratio_is_of_means_and_not_a_mean_of_ratios() -> None:
    assert ratio_interval([1.0, 9.0], [1.0, 3.0], seed=0).value == pytest.approx(10 / 4)
    assert ratio_interval([1.0, 9.0], [0.0, 0.0], seed=0).value == np.inf


def test_median() -> None:
    found = median_interval([1.0, 2.0, 100.0], seed=0)
    assert (found.value, found.low, found.high) == (2, 1, 100)


@pytest.mark.parametrize(("hits", "n", "low", "high"), [(9, 10, 0.596, 0.982), (0, 20, 0.0, 0.161), (20, 20, 0.839, 1)])
def test_wilsons_interval_of_a_share(hits: int, n: int, low: float, high: float) -> None:
    found = fraction_interval([True] * hits + [False] * (n - hits))
    assert found.value == hits / n
    assert found.low == pytest.approx(low, abs=1e-3)
    assert found.high == pytest.approx(high, abs=1e-3)


def test_one_instance_has_no_interval() -> None:
    for found in (mean_interval([3.0], 0), fraction_interval([True]), ratio_interval([3.0], [1.0], 0)):
        assert (found.low, found.high) == (None, None)
