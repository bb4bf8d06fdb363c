"""Which of the refined candidates is the result: the one of least expected error of the whole surface.

A full scan shows all that there is to match, and the lowest error is the best candidate. A partial scan does not: of
two models that explain what is seen equally well, one may be far off where nothing was seen. What is there is unknown,
but the candidates themselves are likely answers, each the likelier the lower its error. The risk of a candidate is its
expected distance from them (minimum Bayes risk), so that a candidate which the others bear out wins over a lucky one.
"""

from __future__ import annotations

import torch
from torch import Tensor

from kpred.fitting.candidates import Candidates
from kpred.ops.nearest import nearest_neighbours
from kpred.ops.typing import Bool, Float

TEMPERATURE = 0.6
"""Odds of candidates fall by e for each such share by which their error is above the lowest."""

SEEN_WEIGHT = 2.0
"""Weight of a candidate's own error, the only thing that is known for sure."""

EXCESS_WEIGHT = 0.3
"""Surface of a candidate that likely answers do not have counts so much of surface of theirs that it lacks.

The three were tuned together on slices and depth scans of sa_partnet's split `train`. Without the last, the fullest
candidate always wins: it is near to everything that could be there.
"""

POOL = 6
"""Candidates that are compared, those of lowest error; the others are hopeless."""

ANSWER_POINTS, CANDIDATE_POINTS = 256, 1024
"""On 70 slices of training shapes 512 answer points choose no better (0.999 of the error, 96 % the same)."""

SAMPLING_NOISE = 0.05
"""Errors that differ by no more than this share are equal: another sample of the same surfaces would change as much."""


def ranking(
    candidates: Candidates, errors: Float[Tensor, " candidates"], exact: Bool[Tensor, " candidates"]
) -> list[int]:
    """Rows of all candidates, the result first, as `fit` ranks them.

    Args:
        errors: as for `order`; exact: which of them are of all points. Others are estimates (`Candidates.errors`).

    Partial scans: `order`. Full scans: by error; but of those that are as good as the best, as far as exact errors
    tell, the one that had to be deformed least comes first.
    """
    if candidates.partial:
        return order(candidates, errors)
    deformation = (candidates.deformed() - candidates.points).square().sum(-1).mean(1)
    as_good = exact & (errors <= errors[exact].min() * (1 + SAMPLING_NOISE))
    first = int(torch.where(as_good, deformation, torch.inf).argmin())
    return [first] + [row for row in errors.argsort(stable=True).tolist() if row != first]


def order(candidates: Candidates, errors: Float[Tensor, " candidates"]) -> list[int]:
    """Rows of all candidates, the result first.

    Args:
        errors: of the candidates, as `Candidates.errors` gives them, with whatever else speaks against them added; unit
            box squared.

    Full scans: by error. Partial scans: those of lowest error by `risks`, then the others by error.
    """
    by_error = errors.argsort(stable=True)
    if not candidates.partial or len(by_error) < 3:
        return by_error.tolist()
    pool = by_error[:POOL]
    best_first = risks(candidates.take(pool).deformed(), errors[pool]).argsort(stable=True)
    return pool[best_first].tolist() + by_error[POOL:].tolist()


def risks(
    results: Float[Tensor, "candidates points 3"], errors: Float[Tensor, " candidates"]
) -> Float[Tensor, " candidates"]:
    """Expected error of each result if the true surface is one of them; unit box squared.

    Args:
        results: their surfaces; errors: their distance from what was seen.
    """
    odds = torch.softmax(-errors / (TEMPERATURE * errors.min().clamp(min=1e-12)), dim=0)
    count, points = len(results), results.shape[1]
    # Disjoint samples: a result is as far from another sample of itself as sampling makes it, and has no advantage.
    answer_step = max(2, points // ANSWER_POINTS)
    answers = results[:, 1::answer_step]
    few = results[:, :: max(2, points // CANDIDATE_POINTS)]
    squared, _ = nearest_neighbours(answers.repeat_interleave(count, 0), few.repeat(count, 1, 1))
    lacking = squared.mean(1).view(count, count)
    return odds @ lacking + EXCESS_WEIGHT * (lacking @ odds) + SEEN_WEIGHT * errors
