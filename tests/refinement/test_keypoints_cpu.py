"""Compiled rounds of refinement do what plain torch does."""

from dataclasses import replace

import pytest
import torch

from kpred.refinement import keypoints as refine
from kpred.refinement.config import RefineConfig
from kpred.refinement.keypoints import Hints, Refined, refine_candidates
from kpred.refinement.symmetry import reflect

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
        return refine_candidates(points, basis, start, goal, confidence, config, partial, network, hints)

    assert refine.refine_compiled is not None
    compiled = refined()
    monkeypatch.setattr(refine, "refine_compiled", None)
    plain = refined()
    assert float((plain.displacement - start).abs().max()) > 0.05
    assert torch.allclose(compiled.displacement, plain.displacement, atol=2e-4)
    assert torch.allclose(compiled.error, plain.error, rtol=1e-2)
    assert torch.equal(start, torch.zeros_like(start)), "the start is not changed in place"
