"""Pose hypotheses of a scan: category and yaw, with their log-odds by the recognizer."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
import torch
from torch import Tensor

from kpred.nn import Recognizer
from kpred.ops.rotations import yaw_rotation
from kpred.ops.typing import Float
from kpred.pose.yaw import yaw_hypotheses

POINTS = 384
"""Number of scan points given to the recognizer; the scan is in random order."""

COARSE_POINTS = 256
"""Number of points for the first pass over all yaws, as in training."""

YAW_STEP = 45
"""Degrees between the yaws of the first pass; the recognizer corrects up to 28 degrees."""

GEOMETRIC_YAWS = 4
"""Number of additional yaws, proposed by straight edges and walls: more exact than a correction."""

BATCH_POINTS = 1536
"""Number of points in one batch of the recognizer."""

SAME_YAW = np.radians(6.0)
"""Yaws closer than this (radians) are one hypothesis."""

MAX_CORRECTED = 4
"""Number of best yaws that are corrected and predicted again."""


@dataclass(frozen=True, eq=False)
class PoseHypothesis:
    """A rotation and a category for a scan.

    Attributes:
        rotation: (3, 3) from the scan's frame to the canonical frame (y up, front +z).
        category: supposed category.
        log_odds: of this category in this pose against no known category; 0 without a recognizer.
    """

    rotation: np.ndarray
    category: str
    log_odds: float = 0.0


def recognize_poses(
    points: Float[np.ndarray, "points 3"],
    upright: Float[np.ndarray, "3 3"],
    recognizer: Recognizer,
    categories: Sequence[str],
) -> list[PoseHypothesis]:
    """Find yaw and category of a scan whose up axis is known; the likeliest hypothesis first.

    A first pass covers yaws all around. The best are corrected by the predicted yaw, or replaced by a nearby geometric
    proposal, and predicted again by the ensemble.

    Args:
        points: in any unit, in random order; upright: rotation that takes the scan's up axis to +y.
        categories: of interest; the recognizer must know them.
    """
    standing = points[:POINTS] @ upright.T
    geometric = yaw_hypotheses(points @ upright.T, GEOMETRIC_YAWS)
    around = [*np.radians(np.arange(0, 360, YAW_STEP)), *geometric]
    odds, missing = predict_logits(standing[:COARSE_POINTS], [yaw_rotation(yaw) for yaw in around], recognizer)
    best = select_odds(odds, recognizer, categories).max(axis=1)
    yaws: list[float] = []
    for row in np.argsort(-best):
        yaw = _nearest(around[row] + missing[row], geometric)
        if all(abs(_difference(yaw, other)) > SAME_YAW for other in yaws):
            yaws.append(yaw)
        if len(yaws) == MAX_CORRECTED:
            break
    rotations = [yaw_rotation(yaw) for yaw in yaws]
    odds, _ = predict_logits(standing, rotations, recognizer.predict_ensemble)
    chosen = select_odds(odds, recognizer, categories)
    return make_hypotheses([rotation @ upright for rotation in rotations], chosen, categories)


def select_odds(
    odds: Float[np.ndarray, "rotations known"], recognizer: Recognizer, categories: Sequence[str]
) -> Float[np.ndarray, "rotations categories"]:
    """Select the log-odds of the categories of interest; the recognizer's other ones then count as none of them.

    A single category of interest is taken as given: nothing else is possible then.
    """
    names = recognizer.config.categories
    selected = odds[:, [names.index(name) for name in categories]]
    rest = [column for column, name in enumerate(names) if name not in categories]
    if len(categories) < 2 or not rest:
        return selected
    return selected - np.logaddexp.reduce(odds[:, rest], axis=1, initial=0.0, keepdims=True)


def make_hypotheses(
    rotations: Sequence[np.ndarray], odds: Float[np.ndarray, "rotations categories"], categories: Sequence[str]
) -> list[PoseHypothesis]:
    """Combine every rotation with every category, the likeliest first."""
    found = [
        PoseHypothesis(rotation, category, float(odds[row, column]))
        for row, rotation in enumerate(rotations)
        for column, category in enumerate(categories)
    ]
    return sorted(found, key=lambda hypothesis: -hypothesis.log_odds)


def predict_logits(
    points: Float[np.ndarray, "points 3"],
    rotations: Sequence[np.ndarray],
    recognizer: Callable[[Tensor], tuple[Tensor, Tensor]],
) -> tuple[Float[np.ndarray, "rotations categories"], Float[np.ndarray, " rotations"]]:
    """Predict, for each rotation of a cloud, log-odds of each category against none, and the missing yaw (radians).

    `recognizer`: a `Recognizer`, or its `predict_ensemble`.
    """
    clouds = np.stack([points @ rotation.T for rotation in rotations])
    with torch.inference_mode():
        # Centred and scaled before single precision loses digits.
        clouds = clouds - clouds.mean(axis=1, keepdims=True)
        clouds = clouds / max(float(np.abs(clouds).max()), np.finfo(float).tiny)
        # A few clouds at a time: activations then stay in the processor's cache.
        answers = [
            recognizer(part) for part in torch.from_numpy(clouds).float().split(max(1, BATCH_POINTS // points.shape[0]))
        ]
        logits, missing = (torch.cat(parts) for parts in zip(*answers, strict=True))
        logits = torch.log_softmax(logits, dim=1)
        # Against "none" alone: other categories are other hypotheses.
        odds = logits[:, :-1] - logits[:, -1:]
    return odds.double().numpy(), missing.double().numpy()


def _nearest(yaw: float, proposals: Sequence[float]) -> float:
    """Return the proposal within 1.5 `SAME_YAW` of a yaw, or the yaw itself."""
    near = [other for other in proposals if abs(_difference(yaw, other)) < 1.5 * SAME_YAW]
    return min(near, key=lambda other: abs(_difference(yaw, other)), default=yaw)


def _difference(a: float, b: float) -> float:
    return float((a - b + np.pi) % (2 * np.pi) - np.pi)
