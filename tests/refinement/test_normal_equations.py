"""Normal equations: agreement with dense least squares."""

import pytest
import torch

from kpred.refinement.normal_equations import NormalEquations

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


def test_the_solution_is_that_of_dense_least_squares(problem: tuple) -> None:
    basis, guess, wanted, weight, held = problem
    equations = NormalEquations(basis, guess)
    equations.add_at(ROWS, wanted, weight)
    found = equations.solve(held)
    for row in range(CANDIDATES):
        # The prior is the squared length of root^T c.
        root = torch.linalg.cholesky(held[row])
        scale = weight[row].sqrt()[:, None]
        left = torch.cat([scale * basis[row], root.T])
        right = torch.cat([scale * (wanted[row] - guess[row]), torch.zeros(KEYPOINTS, 3, dtype=torch.float64)])
        torch.testing.assert_close(found[row], torch.linalg.lstsq(left, right).solution)


def test_the_order_of_what_is_wanted_does_not_matter(problem: tuple) -> None:
    basis, guess, wanted, weight, held = problem
    order = torch.arange(POINTS).flip(0).expand(CANDIDATES, -1)
    all_at_once, by_index = NormalEquations(basis, guess), NormalEquations(basis, guess)
    all_at_once.add_at(ROWS, wanted, weight)
    by_index.add_at(order, wanted[:, order[0]], weight[:, order[0]])
    assert torch.allclose(all_at_once.normal, by_index.normal)
    assert torch.allclose(all_at_once.right, by_index.right)
    assert torch.allclose(all_at_once.level(), all_at_once.normal.diagonal(dim1=1, dim2=2).mean(1))


def test_cleared_equations_want_nothing(problem: tuple) -> None:
    basis, guess, wanted, weight, held = problem
    equations = NormalEquations(basis, guess)
    equations.add_at(ROWS, wanted, weight)
    assert equations.solve(held).abs().max() > 0.01
    equations.clear()
    assert (equations.solve(held) == 0).all()
