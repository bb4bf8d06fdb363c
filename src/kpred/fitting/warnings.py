"""What may be wrong with a result, in sentences for people."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from kpred.fitting.confidence import Evidence
from kpred.fitting.explanation import Explanation
from kpred.fitting.joint_gaps import MAX_GAP
from kpred.ops.typing import Float
from kpred.preprocessing.clean import CleaningStep

LOW_CONFIDENCE = 0.5
"""Results below are more likely wrong than right."""

CLEAR = 0.8
"""A category or a rotation is clear from this probability on."""

MAX_UNEXPLAINED = 0.15
MAX_REMOVED = 0.2
"""Fractions of a scan that the result may leave unexplained, and that cleaning may remove, without a warning."""

COUNTED_STEPS = ("outliers", "floor", "wall")

MIN_GROWTH, MAX_GROWTH = 0.4, 2.5
"""Factors by which a side of a part may shrink or grow without a warning."""

MAX_FLOOR_GAP = 0.02
"""Distance of the feet from the floor without a warning, as a fraction of the result's longest side."""


def warnings_of(
    evidence: Evidence,
    confidence: float,
    category: str,
    category_confidence: dict[str, float],
    cleaning: Sequence[CleaningStep],
    points: int,
    explanation: Explanation | None = None,
    floor_gap: float = 0.0,
    joint_gap: float = 0.0,
) -> tuple[str, ...]:
    """List what a person should look at before the result is used; nothing if nothing speaks against it.

    Args:
        evidence, confidence, category, category_confidence: of the result.
        cleaning: what cleaning removed of the scan's `points` points.
        explanation: how the model was changed; None where it is not known.
        floor_gap: how far the result ends above the floor (below: negative), as a fraction of its longest side.
        joint_gap: between parts that touch in the model, as a fraction of the result's longest side.
    """
    doubts = _doubts(evidence, confidence, category, category_confidence)
    changes = [] if explanation is None else _changes(explanation)
    removed = sum(step.removed for step in cleaning if step.name in COUNTED_STEPS)
    if removed > MAX_REMOVED * points:
        doubts.append(
            f"Cleaning removed {100 * removed / points:.0f} % of the scan as strays, floor or wall; look at the "
            "picture, and leave a step out (--cleaning.floor False, ...) if it took of the object."
        )
    if abs(floor_gap) > MAX_FLOOR_GAP:
        where = "above" if floor_gap > 0 else "below"
        changes.append(f"The result ends {100 * abs(floor_gap):.0f} % of its size {where} the floor.")
    if joint_gap > MAX_GAP:
        changes.append(f"Parts that touch in the model are up to {100 * joint_gap:.0f} % of its size apart.")
    return (*doubts, *changes)


def floor_gap(vertices: Float[np.ndarray, "vertices 3"], floor: float | None) -> float:
    """Measure how far a mesh ends above the floor, as a fraction of its longest side; 0 without a floor.

    Args:
        vertices: y up; floor: its height, in the same frame and unit.
    """
    if floor is None:
        return 0.0
    size = float(np.ptp(vertices, axis=0).max())
    return (float(vertices[:, 1].min()) - floor) / max(size, 1e-12)


def _doubts(evidence: Evidence, confidence: float, category: str, category_confidence: dict[str, float]) -> list[str]:
    """List what speaks against category, rotation and surface."""
    found = []
    if confidence < LOW_CONFIDENCE:
        if evidence.odds is not None and evidence.odds < 0:
            what = f"the scan looks like no {_listed(category_confidence)}, or shows too little of one"
        else:
            what = "little speaks for it"
        found.append(f"The result is more likely wrong than right (confidence {confidence:.2f}): {what}.")
    others = {name: probability for name, probability in category_confidence.items() if name != category}
    if others and evidence.category < CLEAR:
        other = max(others, key=lambda name: others[name])
        found.append(
            f"It may be a {other} as well (probability {others[other]:.2f}); name the category if you know it."
        )
    if evidence.turn < CLEAR:
        found.append(
            f"It may face another way (probability of this way {evidence.turn:.2f}); give its pose if you know it."
        )
    if evidence.unexplained > MAX_UNEXPLAINED:
        found.append(
            f"{100 * evidence.unexplained:.0f} % of the scan lie farther than 5 % of the object's size from the "
            "result: another thing may be in the scan."
        )
    return found


def _changes(explanation: Explanation) -> list[str]:
    """List what the deformation did to the model that a designer would not."""
    found = []
    if explanation.step in ("free", "paper"):
        found.append("The model was bent: what is flat, straight or square in it may no longer be so.")
    if explanation.structure is not None:
        growth = explanation.structure.growth()
        missing = "a model closer to the scan may be missing in the database"
        if growth.max() > MAX_GROWTH:
            found.append(f"A part grew to {growth.max():.1f} times its size: {missing}.")
        if growth.min() < MIN_GROWTH:
            found.append(f"A part shrank to {growth.min():.2f} times its size: {missing}.")
    return found


def _listed(names: dict[str, float]) -> str:
    *first, last = names
    return f"{', '.join(first)} or {last}" if first else last
