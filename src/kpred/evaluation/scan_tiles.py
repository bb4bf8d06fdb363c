"""Tiles of a contact sheet: the worst virtual scans, then some typical ones."""

from __future__ import annotations

import math
from collections.abc import Sequence

from kpred.evaluation.contact_sheet import Tile, Verdict
from kpred.evaluation.scan_outcomes import ScanOutcome
from kpred.evaluation.scan_summaries import DOUBTED
from kpred.evaluation.scan_targets import ScanTarget
from kpred.training.recognition_data import OTHER

Shown = tuple[ScanTarget, ScanOutcome]


def worst_and_typical(shown: Sequence[Shown], worst: int) -> list[Tile]:
    """Tiles of the `worst` worst, and of half as many around the median that are not among them.

    Worst are fits that failed, then things of no category by how confident the result is, then wrong results, then
    right ones, each by the mean distance from the whole surface.
    """
    order = sorted(shown, key=lambda pair: _badness(pair[1]), reverse=True)
    first, rest = order[:worst], order[worst:]
    # The median of all, which may be among the worst of few.
    middle = max(0, len(order) // 2 - worst - worst // 4)
    return [_tile(*pair) for pair in (*first, *rest[middle : middle + worst // 2])]


def _badness(outcome: ScanOutcome) -> tuple[int, float]:
    if outcome.failure is not None:
        return 3, 0.0
    if outcome.category == OTHER:
        return 2, outcome.confidence if outcome.confidence is not None else 1.0
    return int(not outcome.right), outcome.unknown.distance if outcome.unknown is not None else math.inf


def _tile(target: ScanTarget, outcome: ScanOutcome) -> Tile:
    found = outcome.found or "failed"
    lines = [f"{outcome.category} {target.model_id}", f"found: {found} {outcome.model or ''}".rstrip()]
    facts = [] if outcome.confidence is None else [f"confidence {outcome.confidence:.2f}"]
    if outcome.yaw is not None:
        facts.append(f"yaw {outcome.yaw:.0f}° off ({outcome.symmetry})")
    if outcome.unknown is not None:
        facts.append(f"distance {outcome.unknown.distance:.3f} unit box")
    lines.append(outcome.failure or ", ".join(facts))
    noticed = outcome.category == OTHER and (outcome.warnings or (outcome.confidence or 1.0) < DOUBTED)
    verdict: Verdict = "right" if outcome.right else "open" if noticed else "wrong"
    return Tile(tuple(lines), verdict, target.known, outcome.result)
