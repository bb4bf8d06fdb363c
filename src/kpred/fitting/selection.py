"""Which of the deformed candidates is the result: the simplest good explanation, and for unseen parts the safest.

Of a whole scan the lowest score wins: log error plus the cost of what had to be changed. A partial scan shows less: of
two models that explain what is seen equally well, one may be far off where nothing was seen. The candidates themselves
are likely answers, each the likelier the lower its score. The risk of a candidate is its expected distance from them
(minimum Bayes risk), so that a candidate which others bear out wins over a lucky one.
"""

from __future__ import annotations

import numpy as np
import torch
from torch import Tensor

from kpred.fitting.deform import WHOLE
from kpred.fitting.explanation import Deformed
from kpred.fitting.joint_gaps import unbroken_first
from kpred.ops.nearest import nearest_neighbours
from kpred.ops.typing import Float
from kpred.refinement.free_space import free_space_errors

TEMPERATURE = 0.6
"""Odds of candidates fall by e for each such fraction by which their error is above the lowest."""

TOKEN_WEIGHT = 10.0
"""Odds of candidates fall by e to this for each time that their token distance is above the lowest by itself."""

SEEN_WEIGHT = 0.5
"""Weight of a candidate's own error, the only thing that is known for sure."""

EXCESS_WEIGHT = 0.3
"""Surface of a candidate that likely answers do not have counts so much of surface of theirs that it lacks.

The three were tuned together on slices and depth scans of sa_partnet's split `train`. Without the last, the fullest
candidate always wins: it is near to everything that could be there.
"""

POOL = 10
"""Candidates that are compared by risk, those of the lowest score."""

ANSWER_POINTS, CANDIDATE_POINTS = 256, 1024
"""On 70 slices of training shapes 512 answer points choose no better (0.999 of the error, 96 % the same)."""


def rank_candidates(deformed: Deformed) -> list[int]:
    """List rows of all candidates, the result first; those that were only estimated follow the others."""
    scores = np.array([one.score for one in deformed.explanations])
    sensors = deformed.candidates.sensors
    if sensors is not None:
        results = torch.from_numpy(np.stack([one.points for one in deformed.explanations]))
        filled = free_space_errors(results, deformed.candidates.target, sensors).numpy()
        scores = np.log(np.exp(scores) + filled)
    final = np.array([one.final for one in deformed.explanations])
    by_score = [int(row) for row in np.lexsort((scores, ~final))]
    if deformed.seen > WHOLE or final.sum() < 3:
        return unbroken_first(deformed, by_score)
    pool = [row for row in by_score if final[row]][:POOL]
    results = torch.from_numpy(np.stack([deformed.explanations[row].points for row in pool]))
    tokens = deformed.candidates.distances[pool]
    prior = -TOKEN_WEIGHT * (tokens / max(float(tokens.min()), 1e-12) - 1.0)
    risk = risks(results, torch.from_numpy(np.exp(scores[pool])).float(), torch.from_numpy(prior).float())
    first = [pool[int(place)] for place in risk.argsort(stable=True)]
    return unbroken_first(deformed, first + [row for row in by_score if row not in first])


def risks(
    results: Float[Tensor, "candidates points 3"],
    errors: Float[Tensor, " candidates"],
    prior: Float[Tensor, " candidates"] | None = None,
) -> Float[Tensor, " candidates"]:
    """Compute the expected error of each result if the true surface is one of them; unit box squared.

    Args:
        results: their surfaces; errors: their distance from what was seen; prior: log odds before that.
    """
    evidence = -errors / (TEMPERATURE * errors.min().clamp(min=1e-12))
    odds = torch.softmax(evidence if prior is None else evidence + prior, dim=0)
    count, points = len(results), results.shape[1]
    # Disjoint samples: a result is as far from another sample of itself as sampling makes it, and has no advantage.
    answer_step = max(2, points // ANSWER_POINTS)
    answers = results[:, 1::answer_step]
    few = results[:, :: max(2, points // CANDIDATE_POINTS)]
    squared, _ = nearest_neighbours(answers.repeat_interleave(count, 0), few.repeat(count, 1, 1))
    lacking = squared.mean(1).view(count, count)
    return odds @ lacking + EXCESS_WEIGHT * (lacking @ odds) + SEEN_WEIGHT * errors
