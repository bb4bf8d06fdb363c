"""Reliability: calibrated confidence has no error, ranking is what the area says, and no fit falls out of the bins."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from kpred.evaluation.metrics.reliability import area_under_roc, reliability

FITS = st.lists(st.tuples(st.floats(0, 1), st.booleans()), min_size=1, max_size=40)


@given(FITS)
def test_bins_hold_every_fit_once_and_the_error_is_a_share(fits: list[tuple[float, bool]]) -> None:
    confidence, right = zip(*fits, strict=True)
    found = reliability(confidence, right)
    assert sum(part.n for part in found.bins) == found.n == len(fits)
    assert sum(part.n * part.right for part in found.bins) == pytest.approx(sum(right))
    assert 0 <= found.ece <= 1
    for part in found.bins:
        assert part.low - 1e-9 <= part.confidence <= part.high + 1e-9
    # Averaging within bins hides errors and never makes them.
    assert found.ece >= abs(np.mean(confidence) - np.mean(right)) - 1e-9


@given(FITS)
def test_the_area_is_the_chance_that_right_is_ranked_above_wrong(fits: list[tuple[float, bool]]) -> None:
    confidence, right = (np.array(part) for part in zip(*fits, strict=True))
    pairs = [np.sign(a - b) for a in confidence[right] for b in confidence[~right]]
    area = area_under_roc(confidence, right)
    if not pairs:
        assert area is None
    else:
        assert area == pytest.approx((np.mean(pairs) + 1) / 2)


def test_calibrated_confidence_has_hardly_an_error_and_boasting_has() -> None:
    rng = np.random.default_rng(0)
    said = rng.random(20_000)
    right = rng.random(20_000) < said
    assert reliability(said.tolist(), right.tolist()).ece < 0.02
    assert reliability(np.ones(20_000).tolist(), right.tolist()).ece == pytest.approx(0.5, abs=0.02)


def test_known_numbers() -> None:
    found = reliability([0.05, 0.95, 1.0, 0.95], [False, True, False, True])
    assert [(part.n, part.right) for part in found.bins] == [(1, 0), (3, pytest.approx(2 / 3))]
    assert found.ece == pytest.approx(0.25 * 0.05 + 0.75 * (2.9 / 3 - 2 / 3))
    assert found.auc == pytest.approx(0.5)
    assert area_under_roc([0.1, 0.2, 0.9], [False, False, True]) == 1
    assert area_under_roc([0.9, 0.2], [False, True]) == 0


def test_what_is_no_probability_is_refused() -> None:
    with pytest.raises(ValueError, match="probabilities"):
        reliability([1.2], [True])
    with pytest.raises(ValueError, match="probabilities"):
        reliability([float("nan")], [True])
    with pytest.raises(ValueError, match="pairs"):
        reliability([], [])
