"""Measurement of visibility: numbers of predictions that are known."""

import math

import pytest
import torch
from measure_visibility import CASES, measure_visibility, summarize

from kpred.errors import PackError
from kpred.nn import VisibilityConfig, VisibilityNetwork
from kpred.synthetic.generator import generate


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
