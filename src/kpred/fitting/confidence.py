"""How likely a result is right: what is known about a fit, and a probability calibrated on scans held out."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import torch

from kpred.errors import ModelError
from kpred.fitting.hypotheses import Hypothesis
from kpred.nn.calibration import Calibration
from kpred.ops import nearest_neighbours
from kpred.ops.rotations import yaw_rotation
from kpred.ops.sampling import subsample
from kpred.ops.typing import Float

UNEXPLAINED_DISTANCE = 0.1
"""Scan points farther than this from the result are not explained by it, unit box."""

EXPLAINED, DOUBT_WIDTH = 0.1, 0.15
"""Unexplained fraction of a scan from which on confidence falls, and the fraction beyond that divides it by e."""

SAME_YAW = math.radians(20.0)
"""Readings whose turns differ by less than this are one, as far as confidence goes."""

SAME_SHAPE = 0.03
"""A turn leaves a result as it is if the turned one is, in the mean, no farther from it than this, unit box."""

EVIDENCE_POINTS = 512
SHAPE_POINTS = 512

TEMPERATURE = 1.0
"""Scores of readings are divided by this before they are made probabilities."""

FEATURES = (
    "constant",
    "log error",
    "unexplained",
    "seen",
    "log-odds of category",
    "log-odds of rotation",
    "log box error",
    "log change",
    "recognizer's log-odds",
)
"""Names of `Evidence.features`, in order."""


@dataclass(frozen=True)
class Evidence:
    """Evidence of a fit for its confidence.

    Attributes:
        error: root mean square distance from the scan to the result, unit box.
        unexplained: fraction of the scan's points that are farther than `UNEXPLAINED_DISTANCE` from the result.
        seen: mean confidence of the keypoints, D_i in [0, 1].
        category: probability of the category among those tried.
        turn: probability of the turn among those tried, turns that leave the result as it is being one.
        odds: the recognizer's log-odds of the reading against "none of the categories"; None where there is none.
        box: mean error that the network expects of the whole object's box, unit box; 0 where the frame is known.
        change: root mean square distance by which the model was changed, unit box.
    """

    error: float
    unexplained: float
    seen: float
    category: float
    turn: float
    odds: float | None
    box: float
    change: float = 0.0

    def features(self) -> Float[np.ndarray, " features"]:
        """Return the features of the logistic regression; the last, the odds, only if there are any."""
        numbers = [
            1.0,
            math.log(max(self.error, 1e-3)),
            min(self.unexplained, 0.5),
            self.seen,
            _log_odds(self.category),
            _log_odds(self.turn),
            math.log(max(self.box, 1e-2)),
            math.log(max(self.change, 1e-2)),
        ]
        return np.array(numbers if self.odds is None else [*numbers, max(-8.0, min(8.0, self.odds))])


def confidence(evidence: Evidence, calibration: Calibration | None = None) -> float:
    """Compute the probability that category, yaw and surface of a result are right.

    A regression on the evidence, and a factor that falls with the unexplained fraction of the scan: whatever else
    speaks for a result, one that leaves a quarter of the scan unexplained is more likely wrong.

    Args:
        calibration: of the model; None takes `BUILT_IN`.

    Raises:
        ModelError: the calibration is of other features.
    """
    chosen = BUILT_IN if calibration is None else calibration
    if chosen.features != FEATURES:
        raise ModelError("The model's calibration.json is of another version; run `kpred train confidence` again.")
    weights = np.array(chosen.weights_without_odds if evidence.odds is None else chosen.weights)
    supported = 1.0 / (1.0 + math.exp(-float(np.clip(evidence.features() @ weights, -30, 30))))
    return float(supported * explained_factor(evidence.unexplained))


def explained_factor(unexplained: float) -> float:
    """Compute the factor in (0, 1] by which an unexplained fraction of the scan lowers confidence."""
    return math.exp(-((max(0.0, unexplained - EXPLAINED) / DOUBT_WIDTH) ** 2))


def evidence_of(
    chosen: Hypothesis,
    result: Float[torch.Tensor, "points 3"],
    undeformed: Float[torch.Tensor, "points 3"],
    tried: Sequence[Hypothesis],
    scored: bool,
) -> Evidence:
    """Gather the evidence of a result.

    Args:
        chosen: the hypothesis that was taken; tried: all hypotheses, `chosen` among them.
        result: points of the deformed model, undeformed: the same points as the placed model has them; unit box.
        scored: a recognizer gave the readings their odds.
    """
    target = chosen.candidates.target
    some = subsample(target, EVIDENCE_POINTS)
    squared = nearest_neighbours(some[None], result[None])[0][0]
    return Evidence(
        error=float(squared.mean().sqrt()),
        unexplained=float((squared > UNEXPLAINED_DISTANCE**2).float().mean()),
        seen=float(chosen.candidates.confidence.mean()),
        category=category_probabilities(tried)[chosen.category],
        turn=_turn_probability(chosen, result, tried),
        odds=chosen.log_odds if scored else None,
        box=chosen.box_error,
        change=float((result - undeformed).square().sum(1).mean().sqrt()),
    )


def category_probabilities(tried: Sequence[Hypothesis]) -> dict[str, float]:
    """Return the probability of each category tried, by its best hypothesis, the likeliest first."""
    best: dict[str, float] = {}
    for one in tried:
        best[one.category] = max(one.score, best.get(one.category, -math.inf))
    order = sorted(best, key=lambda name: -best[name])
    return dict(zip(order, _softmax([best[name] for name in order]), strict=True))


def _turn_probability(chosen: Hypothesis, result: torch.Tensor, tried: Sequence[Hypothesis]) -> float:
    """Compute the probability of the chosen yaw among hypotheses of the same category."""
    scores, same = [], []
    for one in tried:
        if one.category != chosen.category:
            continue
        difference = one.frame.rotation @ chosen.frame.rotation.T
        angle = math.acos(max(-1.0, min(1.0, (float(np.trace(difference)) - 1) / 2)))
        upright = difference[1, 1] > math.cos(SAME_YAW)
        scores.append(one.score)
        same.append(angle < SAME_YAW or (upright and _unchanged(result, difference)))
    return sum(fraction for fraction, is_same in zip(_softmax(scores), same, strict=True) if is_same)


def _unchanged(result: torch.Tensor, turn: np.ndarray) -> bool:
    """Test whether a rotation about the middle of its box leaves a cloud as it is."""
    few = result[:: max(1, len(result) // SHAPE_POINTS)]
    centred = few - (few.amin(0) + few.amax(0)) / 2
    yaw = math.atan2(turn[0, 2] - turn[2, 0], turn[0, 0] + turn[2, 2])
    turned = centred @ torch.from_numpy(yaw_rotation(yaw)).float().T
    spacing = math.sqrt(float(nearest_neighbours(centred[None, ::2], centred[None, 1::2])[0].mean()))
    squared, _ = nearest_neighbours(centred[None], turned[None].contiguous())
    return float(squared.sqrt().mean()) - spacing < SAME_SHAPE


def _softmax(scores: Sequence[float]) -> list[float]:
    values = np.exp((np.array(scores) - max(scores)) / TEMPERATURE)
    return (values / values.sum()).tolist()


def _log_odds(probability: float) -> float:
    clipped = min(max(probability, 1e-3), 1 - 1e-3)
    return math.log(clipped / (1 - clipped))


BUILT_IN = Calibration(
    FEATURES,
    (-5.245, -0.272, -0.068, 0.206, 0.05, 0.099, -0.735, 0.0, 0.618),
    (-7.305, -0.158, -0.159, 0.336, 0.18, 0.284, -1.292, 0.0),
    {},
)
"""Of models without a calibration of their own: of virtual scans of generated shapes, 120 of each category and of other
things (`kpred train confidence`).
"""
