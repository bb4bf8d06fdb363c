"""The choice among refined candidates: lowest error of full scans, least expected error of partial ones."""

from dataclasses import replace

import numpy as np
import torch

from kpred.fitting.candidates import CLOSEST, CLOSEST_PARTIAL, Candidates
from kpred.fitting.choice import order, ranking, risks


def _board(low: tuple[float, float, float], high: tuple[float, float, float], seed: int) -> torch.Tensor:
    """2048 points in a box, as a flat stand-in for a surface."""
    sample = torch.rand(2048, 3, generator=torch.Generator().manual_seed(seed))
    return torch.tensor(low) + sample * (torch.tensor(high) - torch.tensor(low))


def _candidates(clouds: list[torch.Tensor], partial: bool) -> Candidates:
    points = torch.stack(clouds)
    return Candidates(
        model_ids=tuple(f"model_{row}" for row in range(len(clouds))),
        category="table",
        distances=np.arange(len(clouds), dtype=np.float32),
        points=points,
        basis=torch.zeros(*points.shape[:2], 12),
        displacement=torch.zeros(len(clouds), 12, 3),
        target=clouds[0][:100],
        confidence=torch.ones(12),
        partial=partial,
    )


def _alike_and_odd() -> list[torch.Tensor]:
    """Half a table top, and three tops that agree."""
    tops = [_board((-1, 0.4 + 0.1 * row, -1), (1, 0.5 + 0.1 * row, 1), row) for row in range(3)]
    return [_board((-1, 0.5, -1), (0, 0.6, 1), 7), *tops]


def test_full_scans_take_the_lowest_error() -> None:
    errors = torch.tensor([0.02, 0.03, 0.011, 0.011])
    assert order(_candidates(_alike_and_odd(), partial=False), errors) == [2, 3, 0, 1]


def test_of_equal_candidates_of_a_partial_scan_one_that_others_bear_out_comes_first() -> None:
    errors = torch.tensor([0.0099, 0.01, 0.01, 0.01])
    found = order(_candidates(_alike_and_odd(), partial=True), errors)
    assert found[-1] == 0
    assert sorted(found) == [0, 1, 2, 3]
    # The middle one is the nearest to both of the others.
    assert found[0] == 2


def test_a_far_lower_error_wins_over_agreement() -> None:
    errors = torch.tensor([0.001, 0.01, 0.01, 0.01])
    assert order(_candidates(_alike_and_odd(), partial=True), errors)[0] == 0


def test_the_order_does_not_depend_on_the_order_of_the_candidates() -> None:
    clouds, errors = _alike_and_odd(), torch.tensor([0.0099, 0.0101, 0.0100, 0.0102])
    found = order(_candidates(clouds, partial=True), errors)
    turned = order(_candidates(clouds[::-1], partial=True), errors.flip(0))
    assert [3 - row for row in turned] == found


def test_hopeless_candidates_follow_by_error() -> None:
    clouds = _alike_and_odd() + _alike_and_odd()
    errors = torch.tensor([0.01, 0.01, 0.01, 0.01, 0.9, 0.01, 0.01, 0.8])
    assert order(_candidates(clouds, partial=True), errors)[6:] == [7, 4]


def test_surface_that_no_other_has_counts_against_a_candidate() -> None:
    tops = [_board((-1, 0.4, -1), (1, 0.5, 1), seed) for seed in range(5)]
    lower = _board((-1, -1, -1), (1, -0.9, 1), 7)
    risk = risks(torch.stack([torch.cat([tops[0][::2], lower[::2]]), *tops]), torch.full((6,), 0.01))
    assert (risk[0] > risk[1:]).all()


def test_results_that_are_one_have_one_risk() -> None:
    top = _board((-1, 0.4, -1), (1, 0.5, 1), 1)
    risk = risks(top.expand(4, -1, -1), torch.full((4,), 0.01))
    assert torch.allclose(risk, risk[:1].expand(4))


def test_of_equal_full_candidates_the_least_deformed_one_is_first() -> None:
    board = _candidates([_board((-1, 0, -1), (1, 0.1, 1), 0)] * 4, partial=False)
    moved = replace(board, basis=torch.ones(4, 2048, 12) / 12, displacement=torch.ones(4, 12, 3))
    moved.displacement[:] *= torch.tensor([0.4, 0.1, 0.2, 0.01])[:, None, None]
    errors, exact = torch.tensor([0.0100, 0.0103, 0.0104, 0.0200]), torch.tensor([True, True, True, True])
    assert ranking(moved, errors, exact) == [1, 0, 2, 3]
    # An estimate may be off: none of those is the result.
    assert ranking(moved, errors, torch.tensor([True, False, True, True])) == [2, 0, 1, 3]


def test_errors_of_close_candidates_are_exact_and_others_near() -> None:
    clouds = [_board((-1, 0.0, -1), (1, 0.1 + 0.02 * row, 1), row) for row in range(6)]
    clouds += [_board((-1, 0.5, -1), (0, 0.6, 1), 9)]
    for partial in (False, True):
        candidates = replace(_candidates(clouds, partial), target=_board((-1, 0.0, -1), (1, 0.1, 1), 11))
        wanted = candidates.errors()
        errors, exact = candidates.closest_errors()
        assert 1 <= int(exact.sum()) <= (CLOSEST_PARTIAL if partial else CLOSEST) and bool(exact[wanted.argmin()])
        assert torch.equal(errors[exact], wanted[exact])
        assert torch.allclose(errors, wanted, rtol=0.25)
        stopped = replace(candidates, stopped=torch.arange(7) > 1)
        errors, exact = stopped.closest_errors()
        assert errors[2:].isinf().all() and not exact[2:].any() and exact[:2].any()
