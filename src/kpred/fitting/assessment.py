"""How far a result can be trusted, and what a person should look at before using it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import torch

from kpred.fitting.confidence import Evidence, category_probabilities, confidence, evidence_of
from kpred.fitting.explanation import Deformed
from kpred.fitting.joint_gaps import joint_factor, joint_gap
from kpred.fitting.placed import Placed
from kpred.fitting.stages import CleanScan, Context, Tried
from kpred.fitting.warnings import floor_gap, warnings_of


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
        context.recognizer is not None,
    )
    parted = joint_gap(explanation)
    sure = confidence(evidence, context.model.calibration_of(context.categories)) * joint_factor(parted)
    of_categories = category_probabilities(tried.every)
    frame = tried.best.frame
    floor = None if scan.floor is None else (scan.floor - float((frame.rotation @ frame.center)[1])) / frame.scale
    gap = floor_gap(frame.to_unit(np.asarray(placed.mesh.vertices)), floor)
    category = candidates.category
    sentences = warnings_of(evidence, sure, category, of_categories, scan.steps, scan.size, explanation, gap, parted)
    return Assessment(sure, of_categories, evidence, sentences)
