"""Selection among deformed candidates: the lowest score of whole scans, the least expected error of partial ones."""

from collections.abc import Sequence

import numpy as np
import pytest
import torch

from kpred.fitting.candidates import Candidates
from kpred.fitting.explanation import Deformed, Explanation
from kpred.fitting.selection import rank_candidates, risks
from kpred.fitting.visibility import all_seen
from kpred.refinement.placement import Placement
from kpred.refinement.score import Distances


def _board(low: tuple[float, float, float], high: tuple[float, float, float], seed: int) -> torch.Tensor:
    """2048 points in a box, as a flat stand-in for a surface."""
    sample = torch.rand(2048, 3, generator=torch.Generator().manual_seed(seed))
    return torch.tensor(low) + sample * (torch.tensor(high) - torch.tensor(low))


def _deformed(
    clouds: Sequence[torch.Tensor],
    errors: Sequence[float],
    seen: float,
    stopped: Sequence[int] = (),
    sensors: torch.Tensor | None = None,
    tokens: Sequence[float] | None = None,
) -> Deformed:
    """Candidates with these surfaces and errors, the scores being their logarithms."""
    points = torch.stack(list(clouds))
    count = len(clouds)
    candidates = Candidates(
        model_ids=tuple(f"model_{row}" for row in range(count)),
        category="table",
        distances=np.ones(count) if tokens is None else np.array(tokens),
        points=points,
        basis=torch.zeros(count, points.shape[1], 12),
        displacement=torch.zeros(count, 12, 3),
        target=clouds[0][:100],
        confidence=torch.ones(12),
        partial=seen < 1,
        sensors=sensors,
    )
    explanations = tuple(
        Explanation(
            "none",
            lambda model: model.points,
            cloud.numpy(),
            Distances(forth=error, back=0.0, bounded=error, floor=0.0, seen=seen),
            float(np.log(error)),
            Placement.identity(),
            final=row not in stopped,
        )
        for row, (cloud, error) in enumerate(zip(clouds, errors, strict=True))
    )
    return Deformed(candidates, all_seen(), explanations, seen)


def _alike_and_odd() -> list[torch.Tensor]:
    """Half a table top, and three tops that agree."""
    tops = [_board((-1, 0.4 + 0.1 * row, -1), (1, 0.5 + 0.1 * row, 1), row) for row in range(3)]
    return [_board((-1, 0.5, -1), (0, 0.6, 1), 7), *tops]


def test_of_a_whole_scan_the_lowest_score_is_first() -> None:
    assert rank_candidates(_deformed(_alike_and_odd(), [0.02, 0.03, 0.011, 0.011], seen=1.0)) == [2, 3, 0, 1]


@pytest.mark.parametrize("seen", [1.0, 0.5])
def test_candidates_that_were_not_deformed_to_the_end_come_last(seen: float) -> None:
    clouds, errors = _alike_and_odd() + _alike_and_odd(), [0.01, 0.01, 0.01, 0.01, 0.001, 0.01, 0.01, 0.0001]
    found = rank_candidates(_deformed(clouds, errors, seen, stopped=(4, 7)))
    assert found[6:] == [7, 4]
    assert sorted(found) == list(range(8))


def test_of_equal_candidates_of_a_partial_scan_one_that_others_bear_out_comes_first() -> None:
    found = rank_candidates(_deformed(_alike_and_odd(), [0.0099, 0.01, 0.01, 0.01], seen=0.5))
    assert found[-1] == 0
    assert sorted(found) == [0, 1, 2, 3]
    # The middle one is the nearest to both of the others.
    assert found[0] == 2


def test_of_equal_candidates_of_a_partial_scan_one_with_nearer_tokens_comes_first() -> None:
    errors = [0.01, 0.01, 0.01, 0.01]
    for row in (1, 3):
        tokens = [3.0 if other != row else 1.0 for other in range(4)]
        assert rank_candidates(_deformed(_alike_and_odd(), errors, seen=0.5, tokens=tokens))[0] == row
        # Of a whole scan all is known that tokens could say.
        whole = _deformed(_alike_and_odd(), errors, seen=1.0, tokens=tokens)
        assert rank_candidates(whole) == [0, 1, 2, 3]


def test_a_far_lower_error_wins_over_agreement() -> None:
    assert rank_candidates(_deformed(_alike_and_odd(), [0.001, 0.01, 0.01, 0.01], seen=0.5))[0] == 0


def test_the_order_does_not_depend_on_the_order_of_the_candidates() -> None:
    clouds, errors = _alike_and_odd(), [0.0099, 0.0101, 0.0100, 0.0102]
    found = rank_candidates(_deformed(clouds, errors, seen=0.5))
    reversed_order = rank_candidates(_deformed(clouds[::-1], errors[::-1], seen=0.5))
    assert [3 - row for row in reversed_order] == found


def test_a_candidate_that_fills_seen_through_space_falls_behind() -> None:
    wall = _board((-1, -1, -0.5), (1, 1, -0.5), 0)
    before_it = wall + torch.tensor([0.0, 0.0, 0.5])
    errors = [0.02, 0.01]
    assert rank_candidates(_deformed([wall, before_it], errors, seen=1.0)) == [1, 0]
    sensor = torch.tensor([[0.0, 0.0, 4.0]])
    assert rank_candidates(_deformed([wall, before_it], errors, seen=1.0, sensors=sensor)) == [0, 1]


def test_surface_that_no_other_has_counts_against_a_candidate() -> None:
    tops = [_board((-1, 0.4, -1), (1, 0.5, 1), seed) for seed in range(5)]
    lower = _board((-1, -1, -1), (1, -0.9, 1), 7)
    risk = risks(torch.stack([torch.cat([tops[0][::2], lower[::2]]), *tops]), torch.full((6,), 0.01))
    assert (risk[0] > risk[1:]).all()


def test_results_that_are_one_have_one_risk() -> None:
    top = _board((-1, 0.4, -1), (1, 0.5, 1), 1)
    risk = risks(top.expand(4, -1, -1), torch.full((4,), 0.01))
    assert torch.allclose(risk, risk[:1].expand(4))
