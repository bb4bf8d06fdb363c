"""What is counted of a piece of work: products, bytes, and nothing for views."""

import pytest
import torch
from traffic import OPERATIONS_A_PAIR, Cost, Peaks, cost_of, peaks

from kpred.ops import nearest


def test_products_and_bytes_are_those_of_the_operations() -> None:
    a, b = torch.zeros(30, 40), torch.zeros(40, 50)
    cost = cost_of(lambda: a @ b)
    assert cost.products == 2 * 30 * 40 * 50
    assert cost.traffic == 4 * (30 * 40 + 40 * 50 + 30 * 50)
    assert cost.operations == 1
    x = torch.zeros(1000)
    assert cost_of(lambda: x + x).traffic == 3 * 4000
    views = cost_of(lambda: x.view(10, 100)[2:5].transpose(0, 1))
    assert (views.traffic, views.operations) == (0, 0)
    # What is expanded is read once.
    assert cost_of(lambda: x[:1].expand(1000) + 1.0).traffic == 4 + 4000


def test_backward_is_counted_too() -> None:
    weight = torch.zeros(8, 8, requires_grad=True)
    cost = cost_of(lambda: (torch.ones(4, 8) @ weight).sum().backward())
    assert cost.products == 2 * (2 * 4 * 8 * 8)


def test_the_fused_search_is_counted_where_there_is_one(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(nearest, "_fused", lambda: nearest.nearest_reference)
    query, reference = torch.rand(2, 5, 3), torch.rand(2, 7, 3)

    def search() -> None:
        kernel = nearest._fused()
        assert kernel is not None
        kernel(query, reference)

    cost = cost_of(search)
    assert cost.pairs == 2 * 5 * 7
    assert nearest._fused() is nearest.nearest_reference, "it is put back"


def test_least_times_follow_from_the_peaks() -> None:
    most = Peaks(products=100.0, plain=10.0, traffic=50.0)
    least = most.seconds(Cost(products=200.0, pairs=5.0, traffic=25.0))
    assert least == {"arithmetic": 2.0 + 5.0 * OPERATIONS_A_PAIR / 10.0, "memory": 0.5}
    measured = peaks(torch.device("cpu"), side=64)
    assert min(measured.products, measured.plain, measured.traffic) > 0
