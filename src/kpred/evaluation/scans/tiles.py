"""Tiles of a contact sheet: the worst virtual scans, some typical ones, and other things taken for furniture."""

from __future__ import annotations

import math
from collections.abc import Sequence

from kpred.evaluation.scans.scan_outcomes import ScanOutcome
from kpred.evaluation.scans.scan_summaries import DOUBTED
from kpred.evaluation.scans.targets import ScanTarget
from kpred.rendering.contact_sheet import Tile, Verdict
from kpred.training.recognition_data import OTHER

Shown = tuple[ScanTarget, ScanOutcome]


def worst_and_typical(shown: Sequence[Shown], worst: int) -> list[Tile]:
    """Tiles of the `worst` worst targets, of half as many around the median, and of as many other things.

    Worst are fits that failed, then wrong results, then right ones, each by the mean distance from the whole surface.
    Of other things (category `other`) those are shown whose results are most confident.
    """
    targets = sorted(
        (pair for pair in shown if pair[1].category != OTHER), key=lambda pair: _badness(pair[1]), reverse=True
    )
    others = sorted(
        (pair for pair in shown if pair[1].category == OTHER), key=lambda pair: pair[1].confidence or 0.0, reverse=True
    )
    first, rest = targets[:worst], targets[worst:]
    # The median of all, which may be among the worst of few.
    middle = max(0, len(targets) // 2 - worst - worst // 4)
    typical = rest[middle : middle + worst // 2]
    return [_tile(*pair) for pair in (*first, *typical, *others[: worst // 2])]


def _badness(outcome: ScanOutcome) -> tuple[bool, bool, float]:
    distance = outcome.unknown.distance if outcome.unknown is not None else math.inf
    return outcome.failure is not None, not outcome.right, distance


def _tile(target: ScanTarget, outcome: ScanOutcome) -> Tile:
    found = f"found: {outcome.found} {outcome.model}" if outcome.failure is None else "failed"
    facts = [] if outcome.confidence is None else [f"confidence {outcome.confidence:.2f}"]
    if outcome.warnings:
        facts.append("warned")
    if outcome.yaw is not None:
        facts.append(f"yaw {outcome.yaw:.0f}° off ({outcome.symmetry})")
    if outcome.unknown is not None:
        facts.append(f"distance {outcome.unknown.distance:.3f} unit box")
    lines = (f"{outcome.category} {target.model_id}", found, outcome.failure or ", ".join(facts))
    return Tile(lines, _verdict(outcome), target.known, outcome.result)


def _verdict(outcome: ScanOutcome) -> Verdict:
    if outcome.category == OTHER:
        doubted = outcome.confidence is None or outcome.confidence < DOUBTED
        return "open" if doubted or outcome.warnings else "wrong"
    return "right" if outcome.right else "wrong"
