"""Support regions: members, counts, padding, and the density confidence."""

import math

import numpy as np
import pytest
import torch
from hypothesis import given
from hypothesis import strategies as st

from kpred.ops.regions import ball_query, density_confidence, gather_points


def _slow_members(points: np.ndarray, center: np.ndarray, radius: float) -> list[int]:
    return [i for i, p in enumerate(points) if ((p - center) ** 2).sum() <= radius**2]


@given(
    seed=st.integers(0, 9999),
    n=st.integers(1, 120),
    count=st.integers(1, 40),
    radius=st.floats(0.05, 2.5),
)
def test_regions_against_a_slow_loop(seed: int, n: int, count: int, radius: float) -> None:
    generator = torch.Generator().manual_seed(seed)
    points = 2 * torch.rand(2, n, 3, generator=generator, dtype=torch.float64) - 1
    centers = 2 * torch.rand(2, 5, 3, generator=generator, dtype=torch.float64) - 1
    index, total = ball_query(points, centers, radius, count)
    assert index.shape == (2, 5, count)
    for b in range(2):
        for k in range(5):
            members = _slow_members(points[b].numpy(), centers[b, k].numpy(), radius)
            chosen = index[b, k].tolist()
            assert total[b, k] == len(members)
            if not members:
                gap = (points[b] - centers[b, k]).square().sum(-1)
                assert set(chosen) == {int(gap.argmin())}
            elif len(members) <= count:
                # All members in their order, then again from the first.
                assert chosen == [members[i % len(members)] for i in range(count)]
            else:
                assert set(chosen) <= set(members)
                ranks = [members.index(i) for i in chosen]
                assert ranks[0] == 0
                steps = np.diff(ranks)
                # Evenly spread: neighbouring slots are apart by the mean step, rounded down or up.
                assert set(steps.tolist()) <= {len(members) // count, math.ceil(len(members) / count)}


def test_the_boundary_belongs_to_the_ball() -> None:
    points = torch.tensor([[[0.5, 0, 0], [0.5000001, 0, 0], [0, 0, -0.5]]], dtype=torch.float64)
    index, total = ball_query(points, torch.zeros(1, 1, 3, dtype=torch.float64), 0.5, 2)
    assert total.item() == 2
    assert index.tolist() == [[[0, 2]]]


def test_gather_takes_each_batch_from_its_own_cloud() -> None:
    values = torch.arange(2 * 4 * 1.0).view(2, 4, 1)
    index = torch.tensor([[[0, 3]], [[1, 1]]])
    assert gather_points(values, index).flatten().tolist() == [0, 3, 5, 5]


def test_density_confidence_is_the_papers_formula() -> None:
    counts = torch.tensor([[0, 5, 17, 10_000]])
    volume = 4 / 3 * math.pi * 0.3**3
    expected = [min(n / (300.0 * volume), 1.0) for n in (0, 5, 17, 10_000)]
    np.testing.assert_allclose(density_confidence(counts, 2048, 0.3, 300.0)[0], expected, rtol=1e-6)
    assert expected[1] < 1  # else the test says nothing


@pytest.mark.parametrize("points", [512, 4096])
def test_density_confidence_does_not_depend_on_the_size_of_the_cloud(points: int) -> None:
    at_full = density_confidence(torch.tensor([[8]]), 2048, 0.3, 300.0)
    scaled = density_confidence(torch.tensor([[8 * points // 2048]]), points, 0.3, 300.0)
    torch.testing.assert_close(at_full, scaled)
    assert at_full.item() < 1
