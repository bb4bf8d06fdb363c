"""Compiled rounds of refinement do what plain torch does."""

from dataclasses import replace

import numpy as np
import pytest
import torch

from kpred.fitting import refine
from kpred.fitting.cage_cpu import fitted_cage, match
from kpred.fitting.refine import Hints, Refined, refine_candidates
from kpred.fitting.refine_config import RefineConfig
from kpred.fitting.reflection import reflect
from kpred.ops.nearest import nearest_reference
from kpred.ops.weighted_sums import LEAST_SCALE, geman_mcclure, robust_scale

CANDIDATES, POINTS, KEYPOINTS = 4, 1500, 12


@pytest.fixture
def problem(generator: torch.Generator) -> tuple[torch.Tensor, ...]:
    """Points, basis, displacement, target, confidence: smooth bases, and a target that some displacement explains."""
    points = 2 * torch.rand(CANDIDATES, POINTS, 3, generator=generator) - 1
    places = 2 * torch.rand(CANDIDATES, KEYPOINTS, 3, generator=generator) - 1
    basis = torch.softmax(-4 * torch.cdist(points, places).square(), dim=2)
    wanted = 0.15 * torch.randn(CANDIDATES, KEYPOINTS, 3, generator=generator)
    target = (points + basis @ wanted)[0, torch.randperm(POINTS, generator=generator)[:1100]]
    confidence = torch.rand(KEYPOINTS, generator=generator)
    return points, basis, torch.zeros(CANDIDATES, KEYPOINTS, 3), target, confidence


@pytest.mark.parametrize("partial", [False, True])
@pytest.mark.parametrize("shared", [False, True])
@pytest.mark.parametrize("robust", [0.0, 8.0])
def test_refinement_is_that_of_plain_torch(
    problem: tuple[torch.Tensor, ...], partial: bool, shared: bool, robust: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    points, basis, start, target, confidence = problem
    goal = target if shared else torch.stack([target + 0.01 * row for row in range(CANDIDATES)])
    config = replace(RefineConfig(), iterations=5, robust=robust)
    hints = Hints(reflection=reflect(target, confidence[:, None].expand(-1, 3))) if partial and shared else None
    network = start + 0.02

    def refined() -> Refined:
        return refine_candidates(
            points, basis, Refined.in_fixed_box(start), goal, confidence, config, partial, network, hints
        )

    assert refine.refine_compiled is not None
    compiled = refined()
    monkeypatch.setattr(refine, "refine_compiled", None)
    plain = refined()
    assert float((plain.displacement - start).abs().max()) > 0.05
    assert torch.allclose(compiled.displacement, plain.displacement, atol=2e-4)
    assert compiled.error is not None and plain.error is not None
    assert torch.allclose(compiled.error, plain.error, rtol=1e-2)
    assert torch.equal(compiled.scale, plain.scale) and torch.equal(compiled.shift, plain.shift)


def _wanted(moved: torch.Tensor, goal: torch.Tensor, turn: int, every: int, partial: bool) -> torch.Tensor:
    """What `match` says, written out."""
    sums = torch.zeros(len(moved), 4)
    asked = goal[turn::every]
    squared, index = nearest_reference(asked[None], moved[None])
    weight = geman_mcclure(squared, robust_scale(squared, 5.0))[0] / len(asked)
    for row, place, share in zip(index[0], asked, weight, strict=True):
        sums[row] += torch.cat([place * share, share[None]])
    if not partial:
        rows = range(turn, len(moved), every)
        squared, index = nearest_reference(moved[None, turn::every], goal[None])
        weight = geman_mcclure(squared, robust_scale(squared, 5.0))[0] / len(rows)
        for row, other, share in zip(rows, index[0], weight, strict=True):
            sums[row] += torch.cat([goal[other] * share, share[None]])
    return sums


@pytest.mark.parametrize("partial", [False, True])
def test_matches_of_a_cage_are_those_of_a_slow_reference(partial: bool, generator: torch.Generator) -> None:
    moved, goal = torch.rand(150, 3, generator=generator), torch.rand(130, 3, generator=generator)
    found = np.full((150, 4), np.nan, np.float32)
    match(moved.numpy(), goal.numpy(), 1, 3, 25.0, LEAST_SCALE, partial, found)
    assert torch.allclose(torch.from_numpy(found), _wanted(moved, goal, 1, 3, partial), atol=1e-6)


@pytest.mark.parametrize("partial", [False, True])
@pytest.mark.parametrize("rounds", [1, 3])
def test_rounds_of_a_cage_are_those_of_a_slow_reference(partial: bool, rounds: int, generator: torch.Generator) -> None:
    columns = torch.rand(90, 8, generator=generator)
    source, goal = torch.rand(90, 3, generator=generator), torch.rand(80, 3, generator=generator)
    held = 0.01 * torch.rand(90, generator=generator)
    start = source + 0.05 * torch.rand(90, 3, generator=generator)
    stiff = torch.diag_embed(torch.rand(3, 8, generator=generator).double() + 0.1)
    found = fitted_cage(
        *(part.numpy() for part in (columns, source, start, held, goal, stiff)),
        rounds=rounds,
        asked_in_turn=2,
        robust=25.0,
        least=LEAST_SCALE,
        partial=partial,
    )
    expected, moved, across = torch.zeros(3, 8, dtype=torch.float64), source, columns.T.double()
    for turn in range(rounds):
        sums = _wanted(moved if turn else start, goal, turn % 2, 2, partial)
        sums += torch.cat([start * held[:, None], held[:, None]], dim=1)
        if turn == 0:
            normal = (across @ (columns * sums[:, 3:]).double()) + stiff
        residual = (sums[:, :3] - sums[:, 3:] * moved).double()
        pull = (across @ residual).T[..., None] - stiff @ expected[..., None]
        expected = expected + torch.linalg.solve(normal, pull)[..., 0]
        moved = source + (columns.double() @ expected.T).float()
    assert np.allclose(found, expected.T, atol=2e-4)
    assert np.abs(found).max() > 0.005


def test_a_cage_without_stiffness_stays_finite(generator: torch.Generator) -> None:
    # Control points that all do the same: the normal matrix is singular.
    column = torch.rand(90, 1, generator=generator)
    source, goal = torch.rand(90, 3, generator=generator), torch.rand(80, 3, generator=generator)
    found = fitted_cage(
        *(part.numpy() for part in (column.expand(-1, 8), source, source, torch.zeros(90), goal)),
        np.zeros((3, 8, 8)),
        rounds=2,
        asked_in_turn=2,
        robust=25.0,
        least=LEAST_SCALE,
        partial=False,
    )
    assert np.isfinite(found).all()
