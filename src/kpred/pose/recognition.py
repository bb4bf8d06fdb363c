"""How a scan may be read: its category and its yaw, with the odds that the recognizer gives each reading."""

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
"""Points of the scan that the recognizer sees, in random order like all of them."""

FIRST_POINTS = 256
"""Points that it sees of all turns, before the best of them are asked again: as many as it was trained with."""

STEP = 45
"""Degrees between the turns that are tried all around; the recognizer corrects up to 28 of them."""

GEOMETRIC = 4
"""Turns tried besides, proposed by straight edges and walls: more exact than a correction."""

AT_ONCE = 1536
"""Points of clouds that the recognizer works on at once."""

SAME = np.radians(6.0)
"""Turns closer than this are one reading."""

CORRECTED = 4
"""Best turns that are corrected and asked again. On 900 depth scans of training shapes as many readings are right as
with six of twelve turns all around.
"""


@dataclass(frozen=True, eq=False)
class Reading:
    """One way to read a scan.

    Attributes:
        rotation: (3, 3) from the scan's frame to the canonical frame (y up, front +z).
        category: what it would be.
        log_odds: for this category in this pose against none of the categories in it; 0 where nothing judged it.
    """

    rotation: np.ndarray
    category: str
    log_odds: float = 0.0


def recognised(
    points: Float[np.ndarray, "points 3"],
    upright: Float[np.ndarray, "3 3"],
    recognizer: Recognizer,
    categories: Sequence[str],
) -> list[Reading]:
    """Readings of a scan whose up axis is known and whose yaw is not, the likeliest first.

    Turns all around are asked first; the best are corrected by what the network says is missing, or moved to the turn
    nearby that straight edges propose, and asked again, with the second opinion.

    Args:
        points: in any unit, in random order; upright: rotation that takes the scan's up axis to +y.
        categories: of interest; the recognizer must know them.
    """
    standing = points[:POINTS] @ upright.T
    geometric = yaw_hypotheses(points @ upright.T, GEOMETRIC)
    around = [*np.radians(np.arange(0, 360, STEP)), *geometric]
    columns = [recognizer.config.categories.index(name) for name in categories]
    odds, missing = ask(standing[:FIRST_POINTS], [yaw_rotation(turn) for turn in around], recognizer)
    best = odds[:, columns].max(axis=1)
    turns: list[float] = []
    for row in np.argsort(-best):
        turn = _nearest(around[row] + missing[row], geometric)
        if all(abs(_difference(turn, other)) > SAME for other in turns):
            turns.append(turn)
        if len(turns) == CORRECTED:
            break
    rotations = [yaw_rotation(turn) for turn in turns]
    odds, _ = ask(standing, rotations, recognizer.agreed)
    return readings([rotation @ upright for rotation in rotations], odds[:, columns], categories)


def readings(
    rotations: Sequence[np.ndarray], odds: Float[np.ndarray, "rotations categories"], categories: Sequence[str]
) -> list[Reading]:
    """Every rotation with every category, the likeliest first."""
    found = [
        Reading(rotation, category, float(odds[row, column]))
        for row, rotation in enumerate(rotations)
        for column, category in enumerate(categories)
    ]
    return sorted(found, key=lambda reading: -reading.log_odds)


def ask(
    points: Float[np.ndarray, "points 3"],
    rotations: Sequence[np.ndarray],
    recognizer: Callable[[Tensor], tuple[Tensor, Tensor]],
) -> tuple[Float[np.ndarray, "rotations categories"], Float[np.ndarray, " rotations"]]:
    """Log-odds of each category against none, and the turn (radians) still missing, for each rotation of a cloud.

    `recognizer`: a `Recognizer`, or its `agreed`.
    """
    clouds = np.stack([points @ rotation.T for rotation in rotations])
    with torch.inference_mode():
        # In place and size of their own before they lose digits to single precision.
        clouds = clouds - clouds.mean(axis=1, keepdims=True)
        clouds = clouds / max(float(np.abs(clouds).max()), np.finfo(float).tiny)
        # A few clouds at a time: what lies between two layers then stays in the processor's cache.
        answers = [
            recognizer(part) for part in torch.from_numpy(clouds).float().split(max(1, AT_ONCE // points.shape[0]))
        ]
        logits, missing = (torch.cat(parts) for parts in zip(*answers, strict=True))
        logits = torch.log_softmax(logits, dim=1)
        # Against "none" alone: other categories are other readings.
        odds = logits[:, :-1] - logits[:, -1:]
    return odds.double().numpy(), missing.double().numpy()


def _nearest(turn: float, proposals: Sequence[float]) -> float:
    """The proposal within `SAME` of a turn, or the turn itself."""
    near = [other for other in proposals if abs(_difference(turn, other)) < 1.5 * SAME]
    return min(near, key=lambda other: abs(_difference(turn, other)), default=turn)


def _difference(a: float, b: float) -> float:
    return float((a - b + np.pi) % (2 * np.pi) - np.pi)
