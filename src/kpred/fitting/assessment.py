"""How far a result can be trusted, and what a person should look at before using it."""

from __future__ import annotations

from dataclasses import dataclass

import torch

from kpred.fitting.confidence import Evidence, category_probabilities, confidence, evidence_of
from kpred.fitting.deform import Deformed
from kpred.fitting.placed import Placed
from kpred.fitting.stages import CleanScan, Context, Tried
from kpred.fitting.warnings import warnings_of


@dataclass(frozen=True)
class Assessment:
    """Attributes:
    confidence: probability that the result is right; of_categories: of each category tried, the likeliest first.
    evidence: what it rests on; warnings: sentences for people.
    """

    confidence: float
    of_categories: dict[str, float]
    evidence: Evidence
    warnings: tuple[str, ...]


def assess(deformed: Deformed, placed: Placed, tried: Tried, scan: CleanScan, context: Context) -> Assessment:
    """Assess the placed result by its distances, the other hypotheses, and what cleaning removed."""
    candidates, explanation = deformed.candidates, placed.explanation
    points = candidates.points[placed.row].double().numpy()
    evidence = evidence_of(
        tried.best,
        torch.from_numpy(explanation.points),
        torch.from_numpy(explanation.placement(points)).float(),
        tried.every,
        context.model.recognizer is not None,
    )
    sure, of_categories = confidence(evidence), category_probabilities(tried.every)
    sentences = warnings_of(evidence, sure, candidates.category, of_categories, scan.steps, scan.size)
    return Assessment(sure, of_categories, evidence, sentences)
