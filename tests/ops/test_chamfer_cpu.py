"""Compiled Chamfer distances of several clouds: those of the plain ones, and estimates that are right in the mean."""

import numpy as np
import pytest
import torch

from kpred.ops.chamfer import chamfer_distance, unilateral_chamfer_distance
from kpred.ops.chamfer_cpu import chamfer_of_each


@pytest.mark.parametrize("one_way", [False, True])
@pytest.mark.parametrize(("count", "other"), [(40, 70), (900, 1100)])
def test_distances_are_those_of_plain_torch(one_way: bool, count: int, other: int, generator: torch.Generator) -> None:
    target, results = torch.randn(count, 3, generator=generator), torch.randn(4, other, 3, generator=generator)
    plain = unilateral_chamfer_distance if one_way else chamfer_distance
    found = chamfer_of_each(target.numpy(), results.numpy(), one_way)
    expected = plain(target.expand(4, -1, -1), results)
    assert np.allclose(found, expected, rtol=1e-5)
    assert found.dtype == np.float32


def test_some_points_are_asked_among_all_of_the_other(generator: torch.Generator) -> None:
    target, results = torch.randn(64, 3, generator=generator), torch.randn(2, 96, 3, generator=generator)
    found = chamfer_of_each(target.numpy(), results.numpy(), step=3, target_step=4)
    squared = torch.cdist(target.expand(2, -1, -1), results).square()
    expected = squared.amin(2)[:, ::4].mean(1) + squared.amin(1)[:, ::3].mean(1)
    assert np.allclose(found, expected, rtol=1e-4)


def test_estimates_are_right_in_the_mean(generator: torch.Generator) -> None:
    target, results = torch.rand(2048, 3, generator=generator), torch.rand(24, 2048, 3, generator=generator) + 0.02
    exact = chamfer_of_each(target.numpy(), results.numpy())
    estimate = chamfer_of_each(target.numpy(), results.numpy(), step=8, target_step=8)
    assert 0.97 < (estimate / exact).mean() < 1.03
    assert not np.allclose(estimate, exact, rtol=1e-3)


def test_no_result_is_no_distance(generator: torch.Generator) -> None:
    assert chamfer_of_each(np.zeros((5, 3), np.float32), np.zeros((0, 7, 3), np.float32)).shape == (0,)
