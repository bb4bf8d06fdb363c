"""From outcomes of scanned catalogue models to summaries.

Metrics (fractions of all scans unless said otherwise; a fit without a result counts as wrong):
    right_model_first, right_model_in_top_k    the scanned model is the result; it is among the candidates
    yaw_right                within 15 degrees up to symmetry
    failed                   no result at all
    distance                 mean distance from the true surface to the result
    milliseconds             of the fit
Of those whose model is right (`group` is `right model first`):
    distance, undeformed_distance    from the true surface to the result, and to the undeformed model, placed
    distance_ratio           median over the scans of distance / undeformed_distance
    board_thickness          median over all boards of their thickness / that of the model's own
    boards_kept              fraction of the boards whose thickness changed by no more than a tenth
    step_none, ...           how far the model was changed
    yaw_right
"""

from __future__ import annotations

from collections.abc import Sequence

from kpred.evaluation.metrics.summary import NO_UNIT, Scope, Summary
from kpred.evaluation.scans.catalogue_outcomes import THICKNESS_KEPT, CatalogueOutcome
from kpred.evaluation.scans.outcome import known_values

FIRST = "right model first"
STEPS = ("none", "scale", "structure")
SIDE, FRAME, SCAN = "longest side", "true unit box", "scan"


def summarise_catalogue(outcomes: Sequence[CatalogueOutcome], scope: Scope) -> list[Summary]:
    """Summarise some outcomes: fractions, means and medians with 95 % intervals."""
    first = [one for one in outcomes if one.first]
    rows = scope.fraction("right_model_first", [one.first for one in outcomes], SCAN)
    rows += scope.fraction("right_model_in_top_k", [one.rank is not None for one in outcomes], SCAN)
    rows += scope.fraction("yaw_right", [one.yaw_right for one in outcomes], SCAN)
    rows += scope.fraction("failed", [one.failure is not None for one in outcomes], SCAN)
    rows += scope.mean("distance", known_values(outcomes, "distance"), SIDE, FRAME)
    rows += scope.median("milliseconds", known_values(outcomes, "milliseconds"), "ms", SCAN)
    return rows + _of_right_models(first, scope)


def _of_right_models(first: Sequence[CatalogueOutcome], scope: Scope) -> list[Summary]:
    thickness = [ratio for one in first for ratio in one.thickness]
    kept = [abs(ratio - 1.0) <= THICKNESS_KEPT for ratio in thickness]
    rows = scope.median("distance", known_values(first, "distance"), SIDE, FRAME, FIRST)
    rows += scope.median("undeformed_distance", known_values(first, "undeformed_distance"), SIDE, FRAME, FIRST)
    rows += scope.median("distance_ratio", known_values(first, "ratio"), NO_UNIT, FRAME, FIRST)
    rows += scope.median("board_thickness", thickness, NO_UNIT, FRAME, FIRST)
    rows += scope.fraction("boards_kept", kept, FRAME, FIRST)
    for step in STEPS:
        rows += scope.fraction(f"step_{step}", [one.step == step for one in first], SCAN, FIRST)
    return rows + scope.fraction("yaw_right", [one.yaw_right for one in first], SCAN, FIRST)
