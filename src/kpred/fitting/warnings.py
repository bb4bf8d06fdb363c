"""What may be wrong with a result, in sentences for people."""

from __future__ import annotations

from collections.abc import Sequence

from kpred.fitting.cleaning import CleaningStep
from kpred.fitting.confidence import Evidence

LOW_CONFIDENCE = 0.5
"""Results below are more likely wrong than right."""

CLEAR = 0.8
"""A category or a turn is clear from this probability on."""

MOST_UNEXPLAINED = 0.15
MOST_REMOVED = 0.5
"""Shares of a scan that the result may leave unexplained, and that cleaning may remove, without a warning."""

COUNTED_STEPS = ("outliers", "floor", "wall")


def warnings_of(
    evidence: Evidence,
    confidence: float,
    category: str,
    category_confidence: dict[str, float],
    cleaning: Sequence[CleaningStep],
    points: int,
) -> tuple[str, ...]:
    """Sentences about what a person should look at before the result is used; none if nothing speaks against it.

    Args:
        evidence, confidence, category, category_confidence: of the result.
        cleaning: what cleaning removed of the scan's `points` points.
    """
    found = []
    if confidence < LOW_CONFIDENCE:
        if evidence.odds is not None and evidence.odds < 0:
            what = f"the scan looks like no {_listed(category_confidence)}, or shows too little of one"
        else:
            what = "little speaks for it"
        found.append(f"The result is more likely wrong than right (confidence {confidence:.2f}): {what}.")
    others = {name: share for name, share in category_confidence.items() if name != category}
    if others and evidence.category < CLEAR:
        other = max(others, key=lambda name: others[name])
        found.append(
            f"It may be a {other} as well (probability {others[other]:.2f}); name the category if you know it."
        )
    if evidence.turn < CLEAR:
        found.append(
            f"It may face another way (probability of this way {evidence.turn:.2f}); give its pose if you know it."
        )
    if evidence.unexplained > MOST_UNEXPLAINED:
        found.append(
            f"{100 * evidence.unexplained:.0f} % of the scan lie farther than 5 % of the object's size from the "
            "result: another thing may be in the scan."
        )
    removed = sum(step.removed for step in cleaning if step.name in COUNTED_STEPS)
    if removed > MOST_REMOVED * points:
        found.append(f"Cleaning removed {100 * removed / points:.0f} % of the scan as strays, floor or wall.")
    return tuple(found)


def _listed(names: dict[str, float]) -> str:
    *first, last = names
    return f"{', '.join(first)} or {last}" if first else last
