"""Normal equations: agreement with dense least squares, fixed and moving boxes."""

import pytest
import torch

from kpred.fitting.normal_equations import NormalEquations, with_box

CANDIDATES, POINTS, KEYPOINTS = 2, 60, 5
ROWS = torch.arange(POINTS).expand(CANDIDATES, -1)
"""Every point of every candidate, in their order."""


@pytest.fixture
def problem(generator: torch.Generator) -> tuple[torch.Tensor, ...]:
    """Basis, guess, what is wanted, weights, and the keypoints' prior, in double precision."""

    def draw(*shape: int) -> torch.Tensor:
        return torch.randn(*shape, generator=generator, dtype=torch.float64)

    basis, guess = draw(CANDIDATES, POINTS, KEYPOINTS), draw(CANDIDATES, POINTS, 3)
    wanted = guess * torch.tensor([1.1, 0.9, 1.05], dtype=torch.float64) + 0.1 * draw(CANDIDATES, POINTS, 3)
    root = draw(CANDIDATES, KEYPOINTS, KEYPOINTS)
    return basis, guess, wanted, draw(CANDIDATES, POINTS).square(), root @ root.transpose(1, 2)


def _cost(problem: tuple[torch.Tensor, ...], found: tuple[torch.Tensor, ...], box_prior: float) -> float:
    """What is to be least."""
    basis, guess, wanted, weight, held = problem
    correction, scale, shift = found
    result = scale[:, None] * (guess + basis @ correction) + shift[:, None]
    data = (weight[..., None] * (result - wanted).square()).sum()
    scaled = scale[:, None] * correction
    keypoints = (scaled.transpose(1, 2) @ held @ scaled).diagonal(dim1=1, dim2=2).sum()
    box = shift.square().sum() + (scale - 1).square().sum()
    return float(data + keypoints + box_prior * box)


@pytest.mark.parametrize("box", ["fixed", "similarity", "per_axis"])
def test_nothing_near_the_solution_is_better(problem: tuple, box: str, generator: torch.Generator) -> None:
    basis, guess, wanted, weight, held = problem
    equations = NormalEquations(basis if box == "fixed" else with_box(basis, guess), guess)
    equations.add_at(ROWS, wanted, weight)
    found = equations.solve(held, box, 0.7)
    best = _cost(problem, found, 0.7)
    for _ in range(30):
        correction, scale, shift = (
            1e-3 * torch.randn(part.shape, generator=generator, dtype=torch.float64) for part in found
        )
        scale = 0 * scale if box == "fixed" else scale[:, :1].expand(-1, 3) if box == "similarity" else scale
        shift = 0 * shift if box == "fixed" else shift
        near = (found[0] + correction, found[1] + scale, found[2] + shift)
        assert _cost(problem, near, 0.7) > best


def test_similarity_has_one_scale(problem: tuple) -> None:
    basis, guess, wanted, weight, held = problem
    equations = NormalEquations(with_box(basis, guess), guess)
    equations.add_at(ROWS, wanted, weight)
    _, scale, _ = equations.solve(held, "similarity", 0.1)
    assert torch.allclose(scale, scale[:, :1].expand(-1, 3))
    _, scale, _ = equations.solve(held, "per_axis", 0.1)
    assert (scale[:, 0] - scale[:, 1]).abs().min() > 0.02


def test_the_order_of_what_is_wanted_does_not_matter(problem: tuple) -> None:
    basis, guess, wanted, weight, held = problem
    order = torch.arange(POINTS).flip(0).expand(CANDIDATES, -1)
    all_at_once, by_index = NormalEquations(basis, guess), NormalEquations(basis, guess)
    all_at_once.add_at(ROWS, wanted, weight)
    by_index.add_at(order, wanted[:, order[0]], weight[:, order[0]])
    assert torch.allclose(all_at_once.normal, by_index.normal)
    assert torch.allclose(all_at_once.right, by_index.right)


def test_level_is_the_keypoints_own(problem: tuple) -> None:
    basis, guess, wanted, weight, _ = problem
    plain, boxed = NormalEquations(basis, guess), NormalEquations(with_box(basis, 100 * guess), guess)
    for equations in (plain, boxed):
        equations.add_at(ROWS, wanted, weight)
    assert torch.allclose(plain.level(KEYPOINTS), boxed.level(KEYPOINTS))
