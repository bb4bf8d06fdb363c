"""Building the result of a fit from what its stages found."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial

import numpy as np
import trimesh

from kpred.fitting.assessment import Assessment
from kpred.fitting.deform import WHOLE
from kpred.fitting.explanation import Deformed
from kpred.fitting.options import FitOptions
from kpred.fitting.placed import Placed, in_own_size, place_mesh
from kpred.fitting.result import Candidate, Fit, Metric
from kpred.fitting.source import FitSource
from kpred.fitting.stages import CleanScan, Tried
from kpred.ops.frames import Frame
from kpred.shapes.unit import LengthUnit, guess_unit


def build_fit(
    scan: CleanScan,
    tried: Tried,
    deformed: Deformed,
    order: Sequence[int],
    placed: Placed,
    assessment: Assessment,
    timings: dict[str, float],
    source: FitSource,
) -> Fit:
    """Gather what the stages found."""
    context, options = source.context, source.options
    frame = tried.best.frame

    def read_mesh(row: int) -> trimesh.Trimesh:
        entry = context.database.entry(deformed.candidates.model_ids[row])
        found = deformed.explanations[row]
        return place_mesh(found if options.known else in_own_size(found, entry, frame), entry, frame)

    candidates = tuple(_candidate(deformed, row, partial(read_mesh, row)) for row in order)
    return Fit(
        mesh=placed.mesh,
        retrieved_mesh=placed.undeformed,
        placement=placed.model,
        source=candidates[0],
        candidates=candidates,
        frame=frame,
        points=scan.points,
        keypoints=placed.keypoints,
        keypoint_confidence=deformed.candidates.confidence.numpy(),
        confidence=assessment.confidence,
        category_confidence=assessment.of_categories,
        category_errors=_category_errors(tried),
        cleaning=scan.steps,
        partial=deformed.candidates.partial,
        seen=deformed.seen,
        unit=_unit(placed, frame, options),
        deform=options.deform,
        frame_known=options.known,
        metrics=_metrics(deformed, placed, options.known),
        timings=timings,
        evidence=assessment.evidence,
        placed=placed,
        source_data=source,
        read_appearance=lambda: context.database.appearance(candidates[0].model_id),
        warnings=assessment.warnings,
    )


def _candidate(deformed: Deformed, row: int, read_mesh: Callable[[], trimesh.Trimesh]) -> Candidate:
    found, one = deformed.candidates, deformed.explanations[row]
    return Candidate(
        found.model_ids[row],
        found.category,
        float(found.distances[row]),
        one.step,
        one.distances.error,
        one.score,
        one.final,
        read_mesh,
    )


def _unit(placed: Placed, frame: Frame, options: FitOptions) -> LengthUnit:
    if options.unit != "auto":
        return LengthUnit(options.unit, "given")
    if options.known:
        return LengthUnit("m", "assumed")
    size = np.ptp(np.asarray(placed.mesh.vertices) @ frame.rotation.T, axis=0)
    return guess_unit(size, placed.entry.category)


def _category_errors(tried: Tried) -> dict[str, float]:
    errors: dict[str, float] = {}
    for one in tried.every:
        errors.setdefault(one.category, one.error)
    return errors


def _metrics(deformed: Deformed, placed: Placed, known: bool) -> tuple[Metric, ...]:
    box = "known unit box" if known else "estimated unit box"
    found = placed.explanation.distances
    both = "chamfer_distance" if deformed.seen > WHOLE else "seen_chamfer_distance"
    return (
        Metric("unilateral_chamfer_distance", found.forth, "unit box squared", box),
        Metric(both, found.error, "unit box squared", box),
        Metric("mean_scan_to_result", placed.distance, "scan units", "scan"),
    )
