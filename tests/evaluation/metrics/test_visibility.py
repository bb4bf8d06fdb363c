"""Measurement of visibility: agreement with slow references, and numbers of predictions that are known."""

import math

import pytest
import torch

from kpred.errors import PackError
from kpred.evaluation.metrics.visibility import (
    CASES,
    area_under_curve,
    calibration_error,
    measure_visibility,
    summarize,
)
from kpred.nn import VisibilityConfig, VisibilityNetwork
from kpred.synthetic.generator import generate


def test_area_under_curve_agrees_with_all_pairs(generator: torch.Generator) -> None:
    scores = torch.randint(0, 12, (80,), generator=generator) / 12  # with ties
    labels = torch.rand(80, generator=generator) < 0.3
    positive, negative = scores[labels, None], scores[None, ~labels]
    expected = ((positive > negative).double() + 0.5 * (positive == negative).double()).mean()
    assert area_under_curve(scores, labels) == pytest.approx(float(expected), abs=1e-9)
    assert math.isnan(area_under_curve(scores, torch.ones(80, dtype=torch.bool)))


def test_calibrated_predictions_have_a_small_error(generator: torch.Generator) -> None:
    probabilities = torch.rand(40_000, generator=generator)
    labels = torch.rand(40_000, generator=generator) < probabilities
    assert calibration_error(probabilities, labels) < 0.02
    assert calibration_error(torch.full((100,), 0.7), torch.ones(100, dtype=torch.bool)) == pytest.approx(0.3, abs=1e-6)


def test_summary_of_known_predictions() -> None:
    labels = torch.tensor([[True, True, False, True], [True, False, True, True]])
    perfect = summarize("x", labels.float(), labels)
    assert (perfect.seen, perfect.hidden, perfect.misread, perfect.auc) == (1.0, 0.0, 0.0, 1.0)
    assert perfect.calibration == 0.0
    doubtful = summarize("x", torch.full((2, 4), 0.5), labels)
    assert (doubtful.misread, doubtful.auc, doubtful.other_auc) == (1.0, 0.5, 0.5)


def test_a_network_that_says_nothing_ranks_nothing() -> None:
    network = VisibilityNetwork(VisibilityConfig(width=16)).eval().requires_grad_(False)
    for parameter in network.output.parameters():
        parameter.zero_()
    pack = generate("table", 3, seed=1, splits=False)
    rows = measure_visibility(network, pack, "source", 128, None, 0)
    assert [row.case for row in rows] == [case.name for case in CASES]
    assert all(row.seen == 0.5 and row.scans == 3 for row in rows)
    assert math.isnan(rows[0].auc) and all(row.auc == 0.5 for row in rows[1:])
    with pytest.raises(PackError, match="val"):
        measure_visibility(network, pack, "val", 128, None, 0)
