"""From outcomes of virtual scans to summaries, a confusion of categories and the reliability of confidence.

Metrics (`unknown`: nothing given but gravity; `known`: box, pose and category given;
see `kpred.evaluation.scans.virtual_scans`):
    ucd_whole_unknown, ucd_whole_known, ucd_whole_ratio         from the whole true surface to the result
    ucd_visible_unknown, ucd_visible_known, ucd_visible_ratio   from what the camera saw, without noise
    distance_whole_unknown   mean distance from the whole true surface to the result
    yaw_right, yaw_error     within 15 degrees up to symmetry; also for each class of symmetry
    up_axis_right            the scan with z up, its up axis not given; all axes are possible
    category_right           of all targets
    centre_error, size_error of the result's box
    right                    category and yaw right and the whole surface within 0.1 unit box on average
    failed                   no result at all; counts as wrong in all fractions
    milliseconds             of the unknown fit
    other_doubted            things of no known category: confidence under 0.5, or refused with an error
    other_warned             with a warning, or refused with an error
    other_unnoticed          neither doubted nor warned of
    other_refused            with an error
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence

from kpred.evaluation.metrics.reliability import Reliability, reliability
from kpred.evaluation.metrics.summary import Scope, Summary
from kpred.evaluation.metrics.symmetry import SYMMETRIES
from kpred.evaluation.scans.outcome import known_values
from kpred.evaluation.scans.scan_outcomes import ScanOutcome
from kpred.training.recognition_data import OTHER

UNIT_BOX = "true unit box of the whole object"
SCAN = "scan"
SQUARED = "unit box squared"
FAILED = "failed"
DOUBTED = 0.5
"""A confidence below this says that the result is rather wrong."""


def summarise(outcomes: Sequence[ScanOutcome], scope: Scope) -> list[Summary]:
    """Summarize some outcomes; UCD and its ratio over those for which both fits gave a result."""
    targets = [outcome for outcome in outcomes if outcome.category != OTHER]
    others = [outcome for outcome in outcomes if outcome.category == OTHER]
    return _of_targets(targets, scope) + _of_others(others, scope)


def confusion(outcomes: Sequence[ScanOutcome]) -> dict[str, dict[str, int]]:
    """Count results by true category and category found; `failed` where there is none."""
    found: dict[str, Counter[str]] = {}
    for outcome in outcomes:
        found.setdefault(outcome.category, Counter())[outcome.found or FAILED] += 1
    return {true: dict(sorted(counts.items())) for true, counts in sorted(found.items())}


def reliability_of(outcomes: Sequence[ScanOutcome]) -> Reliability | None:
    """Reliability of results that have a confidence, None without any; whatever is made of other things is wrong."""
    pairs = [(outcome.confidence, outcome.right) for outcome in outcomes if outcome.confidence is not None]
    if not pairs:
        return None
    return reliability([confidence for confidence, _ in pairs], [right for _, right in pairs])


def _of_targets(targets: Sequence[ScanOutcome], scope: Scope) -> list[Summary]:
    pairs = [(target.unknown, target.known) for target in targets]
    both = [(unknown, known) for unknown, known in pairs if unknown is not None and known is not None]
    fitted = [unknown for unknown, _ in pairs if unknown is not None]
    rows: list[Summary] = []
    for name in ("whole", "visible"):
        unknown = [getattr(errors, name) for errors, _ in both]
        known = [getattr(errors, name) for _, errors in both]
        rows += scope.mean(f"ucd_{name}_unknown", unknown, SQUARED, UNIT_BOX)
        rows += scope.mean(f"ucd_{name}_known", known, SQUARED, UNIT_BOX)
        rows += scope.ratio(f"ucd_{name}_ratio", unknown, known, UNIT_BOX)
    rows += scope.mean("distance_whole_unknown", [errors.distance for errors in fitted], "unit box", UNIT_BOX)
    rows += _of_yaw(targets, scope)
    rows += scope.fraction("up_axis_right", [target.up_right for target in targets], SCAN)
    rows += scope.fraction("category_right", [target.category_right for target in targets], SCAN)
    rows += scope.mean("centre_error", [errors.centre for errors in fitted], "longest side", UNIT_BOX)
    rows += scope.mean("size_error", [errors.size for errors in fitted], "longest side", UNIT_BOX)
    rows += scope.fraction("right", [target.right for target in targets], UNIT_BOX)
    rows += scope.fraction("failed", [target.failure is not None for target in targets], SCAN)
    return rows + scope.median("milliseconds", known_values(targets, "milliseconds"), "ms", SCAN)


def _of_yaw(targets: Sequence[ScanOutcome], scope: Scope) -> list[Summary]:
    rows = scope.fraction("yaw_right", [target.yaw_right for target in targets], SCAN)
    for symmetry in SYMMETRIES:
        alike = [target.yaw_right for target in targets if target.symmetry == symmetry.name]
        rows += scope.fraction("yaw_right", alike, SCAN, group=f"symmetry {symmetry.name}")
    return rows + scope.mean("yaw_error", known_values(targets, "yaw"), "degrees", SCAN)


def _of_others(others: Sequence[ScanOutcome], scope: Scope) -> list[Summary]:
    refused = [other.failure is not None for other in others]
    warned = [bool(other.warnings) or failed for other, failed in zip(others, refused, strict=True)]
    rows = scope.fraction("other_warned", warned, SCAN)
    if all(other.confidence is not None or failed for other, failed in zip(others, refused, strict=True)):
        doubted = [other.confidence is None or other.confidence < DOUBTED for other in others]
        rows += scope.fraction("other_doubted", doubted, SCAN)
        unnoticed = [not (one or two) for one, two in zip(doubted, warned, strict=True)]
        rows += scope.fraction("other_unnoticed", unnoticed, SCAN)
    rows += scope.fraction("other_refused", refused, SCAN)
    return rows + scope.median("other_milliseconds", known_values(others, "milliseconds"), "ms", SCAN)
