"""The main job: from a scan by way of retrieved and deformed candidates to a CAD mesh in the scan's frame."""

from __future__ import annotations

import os
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from typing import Literal

import numpy as np

from kpred.database import Database
from kpred.fitting.assessment import assess
from kpred.fitting.build_fit import build_fit
from kpred.fitting.deform import Deform
from kpred.fitting.options import FitOptions, sensor_positions
from kpred.fitting.placed import place
from kpred.fitting.raw_scan import is_room, read_raw_scan
from kpred.fitting.result import Fit
from kpred.fitting.selection import rank_candidates
from kpred.fitting.source import FitSource
from kpred.fitting.stages import Context, align, find_up, propose_poses, try_poses
from kpred.fitting.stages import clean as clean_points
from kpred.fitting.whole_or_partial import deform_readings
from kpred.nn import Model
from kpred.pose.estimators import PoseEstimator
from kpred.preprocessing.config import CleanConfig
from kpred.preprocessing.room import ROOM_SENTENCE
from kpred.refinement.config import RefineConfig
from kpred.refinement.structure_config import StructureConfig
from kpred.shapes.unit_name import UnitName


def fit(
    scan: str | os.PathLike[str] | np.ndarray,
    model: Model | str | os.PathLike[str] | None = None,
    database: Database | str | os.PathLike[str] | None = None,
    category: str | None = None,
    top_k: int = 10,
    frame: Literal["auto", "known"] = "auto",
    deform: Deform = "auto",
    *,
    partial: bool | None = None,
    up: str = "auto",
    pose: PoseEstimator | str | None = None,
    clean: bool | CleanConfig = True,
    seed: int = 0,
    model_id: str | None = None,
    refinement: RefineConfig | None = None,
    structure: StructureConfig | None = None,
    sensor: np.ndarray | None = None,
    floor: float | None = None,
    unit: UnitName | Literal["auto"] = "auto",
) -> Fit:
    """Find the CAD model that explains a scan of one object, and deform it to the scan.

    Args:
        scan: path of a point cloud or mesh, or points (N, 3) in any unit, at least 64 of them.
        model: trained networks, or their name or folder; None means bundled.
        database: open database or its path; None means bundled.
        category: search this category only; None tries all that model and database share.
        top_k: candidates deformed and compared (paper: 10). Tokens retrieve so many where `deform` is "free" or
            "paper"; else four times as many, of which a sketch of the deformation selects half.
        frame: `auto` finds the scan's yaw and box; `known` takes the scan as canonical (y up, front +z) inside its
            whole object's unit box, which is the paper's protocol.
        deform: how far a model may be changed. `none`: placed, in one size; `scale`: in one size per axis;
            `structure`: its parts move and grow so that what is flat, straight, square and mirrored stays so; `free`:
            as refined keypoints bend it; `paper`: as the network's keypoints bend it (the paper's protocol). `auto`
            takes the simplest of the first three that explains the scan.
        partial: a hint whether parts are missing; None finds out, region by region.
        up: the scan's up axis, one of x, y, z, -x, -y, -z; `auto` finds it (ignored with `frame="known"`).
        pose: an estimator of the scan's rotation or its name (`identity`, `upright`, `given:FILE`); None tries the scan
            as it stands and turned about its up axis.
        clean: remove outliers, repeats, pieces of floor and wall, and even out the density first; with
            `frame="known"` only if settings are given.
        seed: of the sub-sampling of dense scans.
        model_id: fit this model of the database, and no other.
        refinement: settings of the keypoints' refinement; structure: of the structure-keeping deformation.
        sensor: (3,) or (S, 3) where the scanner stood, scan's frame; the result may not fill space it looked through.
        floor: height of the floor along the up axis, scan's frame and unit, where it is known: the object stands on it.
        unit: of the scan's lengths (m, cm, mm, in, ft), for formats in metres; `auto` guesses it from the size.

    Candidates are compared by their error and by what they had to change (`kpred.refinement.score`).

    Returns:
        The fit; `fit.mesh` is in the scan's own frame and units.

    Raises:
        ScanError: if the scan is missing, unreadable, degenerate or too small.
        ModelError, DatabaseError: if they are missing, or the database was made by other weights.
        ConfigError: if an argument has an impossible value.
    """
    options = FitOptions(
        top_k=top_k,
        frame=frame,
        deform=deform,
        partial=partial,
        up=up,
        pose=pose,
        clean=clean,
        seed=seed,
        model_id=model_id,
        refinement=refinement or RefineConfig(),
        structure=structure or StructureConfig(),
        sensors=sensor_positions(sensor),
        floor=floor,
        unit=unit,
    )
    timer = Timer()
    with timer("load"):
        context = Context.load(model, database, category)
        if model_id is not None and category is None:
            context = replace(context, categories=(context.database.entry(model_id).category,))
    return run_fit(scan, context, options, timer)


def run_fit(scan: str | os.PathLike[str] | np.ndarray, context: Context, options: FitOptions, timer: Timer) -> Fit:
    """Fit a scan: read, clean, pose, retrieve, deform, select, place, assess."""
    with timer("read"):
        raw = read_raw_scan(scan, options)
        source = FitSource.of(scan, raw.points, context, options)
    with timer("up"):
        up = find_up(raw, context, options)
    with timer("clean"):
        cloud = clean_points(raw, up, options)
    with timer("pose"):
        readings = propose_poses(cloud, context, options)
    with timer("retrieve"):
        tried = try_poses(cloud, readings, context, options)
    with timer("align"):
        aligned = align(tried, context, options)
    with timer("deform"):
        deformed = deform_readings(
            aligned.best.candidates,
            aligned.whole,
            aligned.visibility,
            options.deform,
            refinement=options.refinement,
            structure=options.structure,
            top_k=options.top_k,
            floor=aligned.floor(cloud, options),
            unit=None if options.known else aligned.best.frame.scale,
        )
    with timer("select"):
        order = rank_candidates(deformed)
    with timer("place"):
        placed = place(deformed, order, aligned.best.frame, context.database, options.known)
    with timer("assess"):
        assessment = assess(deformed, placed, aligned, cloud, context)
        if is_room(raw, up, options):
            assessment = replace(assessment, warnings=(ROOM_SENTENCE, *assessment.warnings))
    return build_fit(cloud, aligned, deformed, order, placed, assessment, timer.seconds, source)


class Timer:
    """Seconds spent in named steps."""

    def __init__(self) -> None:
        self.seconds: dict[str, float] = {}

    @contextmanager
    def __call__(self, name: str) -> Iterator[None]:
        """Time a step."""
        started = time.perf_counter()
        try:
            yield
        finally:
            self.seconds[name] = self.seconds.get(name, 0.0) + time.perf_counter() - started
