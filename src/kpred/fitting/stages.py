"""The stages of a fit before anything is deformed: read, clean, propose poses, try them, align."""

from __future__ import annotations

import os
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import torch

from kpred.database import Database
from kpred.fitting.candidates import Candidates, retrieve_named
from kpred.fitting.defaults import resolve_database, resolve_model, shared_categories
from kpred.fitting.deform import PLACED_POINTS
from kpred.fitting.floor_contact import is_truncated
from kpred.fitting.hypotheses import Hypothesis, Search, hypotheses, initial_frame
from kpred.fitting.options import FitOptions
from kpred.fitting.raw_scan import RawScan, without_strays
from kpred.fitting.visibility import Visibility, all_seen, fills_unit_box, lacks_parts, predicted
from kpred.nn import Model, Recognizer
from kpred.ops.rotations import yaw_rotation
from kpred.pose.proposals import check_known_frame, generate_poses, score_poses, up_axis
from kpred.pose.recognition import PoseHypothesis
from kpred.preprocessing.clean import CleaningStep, clean_scan
from kpred.refinement.placement import Placement, fit_placement
from kpred.refinement.score import distances, spacing

SCAN_POINTS = 2048
"""Points of a scan that a fit uses (N_P of the paper); a denser scan is thinned."""

MAX_READINGS = 5
ODDS_RANGE = 5.0
"""So many readings of a scan are tried, unless their log-odds are this much below the best."""

ALIGNED = 3
"""Candidates by whose undeformed shapes the yaw is made exact."""

MIN_YAW, YAW_GAIN = np.radians(0.3), 0.97
"""A yaw is corrected by no less than this, and where the error falls to no more than this fraction."""


@dataclass(frozen=True, eq=False)
class Context:
    """What a scan is fitted with: networks, the database, and the categories that both know."""

    model: Model
    database: Database
    categories: tuple[str, ...]

    @property
    def recognizer(self) -> Recognizer | None:
        """The model's recognizer that knows all of the categories, if there is one."""
        return self.model.recognizer_of(self.categories)

    @classmethod
    def load(
        cls,
        model: Model | str | os.PathLike[str] | None,
        database: Database | str | os.PathLike[str] | None,
        category: str | None,
    ) -> Context:
        """Load what is not loaded yet; None means bundled.

        Raises:
            ModelError, DatabaseError: they are missing, or the database was made by other weights.
        """
        networks, store = resolve_model(model), resolve_database(database)
        return cls(networks, store, tuple(shared_categories(networks, store, category)))


@dataclass(frozen=True, eq=False)
class CleanScan:
    """A scan of one object, made ready.

    Attributes:
        points: (N, 3), N <= 2048, scan's frame and unit, in random order; size: points before cleaning.
        up: the up axis; floor: height along it, where it is known; steps: what cleaning removed.
    """

    points: np.ndarray
    size: int
    up: str
    floor: float | None
    steps: tuple[CleaningStep, ...]


@dataclass(frozen=True, eq=False)
class Tried:
    """The readings of a scan, tried.

    Attributes:
        best: the hypothesis that is deformed; every: all of them, the likeliest first.
        visibility: of places in the best one's unit box.
        whole: candidates retrieved as for a whole scan, where it is expected to lack parts and may yet be whole.
    """

    best: Hypothesis
    every: tuple[Hypothesis, ...]
    visibility: Visibility
    whole: Candidates | None = None

    def floor(self, scan: CleanScan, options: FitOptions) -> float | None:
        """Height of the floor in the best hypothesis' unit box; None where it is not known."""
        if scan.floor is None or options.known:
            return None
        frame = self.best.frame
        return (scan.floor - float((frame.rotation @ frame.center)[1])) / frame.scale


def find_up(scan: RawScan, context: Context, options: FitOptions) -> str:
    """Find the scan's up axis, unless the caller names it."""
    if options.known:
        return "y"
    config, points = options.clean_config, scan.points
    if options.up == "auto" and config is not None and config.outliers:
        points = without_strays(points, config.outlier_ratio)
    return up_axis(points, options.up, context.recognizer)


def clean(scan: RawScan, up: str, options: FitOptions) -> CleanScan:
    """Remove what is not the object, and thin what is left.

    Raises:
        ScanError: too few points are left.
    """
    points, config = scan.points, options.clean_config
    size = len(points) + sum(step.removed for step in scan.steps)
    if config is None:
        return CleanScan(points[:SCAN_POINTS], size, up, options.floor, scan.steps)
    cleaned = clean_scan(points, up, config, seed=options.seed, floor=options.floor)
    floor = cleaned.floor_height if options.floor is None else options.floor
    return CleanScan(cleaned.points[:SCAN_POINTS], size, up, floor, (*scan.steps, *cleaned.steps))


def propose_poses(scan: CleanScan, context: Context, options: FitOptions) -> list[PoseHypothesis]:
    """List rotations and categories worth trying, the likeliest first.

    Raises:
        ConfigError: the frame is said to be known, and the scan reaches far beyond it.
    """
    recognizer, categories = context.recognizer, context.categories
    if options.known:
        check_known_frame(scan.points)
        found = score_poses(scan.points, [np.eye(3)], recognizer, categories)
    else:
        found = generate_poses(scan.points, scan.up, options.pose, recognizer, categories)
    return worth_trying(found, recognizer is not None)


def worth_trying(readings: Sequence[PoseHypothesis], are_scored: bool) -> list[PoseHypothesis]:
    """Keep readings, by falling odds, that may still turn out best; all of them where nothing scored them."""
    if not are_scored:
        return list(readings)
    return [reading for reading in readings[:MAX_READINGS] if reading.log_odds > readings[0].log_odds - ODDS_RANGE]


def try_poses(scan: CleanScan, readings: Sequence[PoseHypothesis], context: Context, options: FitOptions) -> Tried:
    """Encode, retrieve and quickly fit every reading, by the networks for what the scan shows of the object.

    Raises:
        DatabaseError: the database has no models of a category, or not the named one.
    """
    search = Search(context.model, context.database, options.top_k, options.retrieved, options.known, scan.floor)
    partial = _lacks_parts(scan, readings[0], context, options)
    tried = hypotheses(scan.points, readings, search, partial)
    best = tried[0]
    if options.model_id is not None:
        named = retrieve_named(best.candidates, context.database, options.model_id)
        best = replace(best, candidates=named)
    if options.sensors is not None:
        sensors = torch.from_numpy(best.frame.to_unit(options.sensors)).float()
        best = replace(best, candidates=replace(best.candidates, sensors=sensors))
    whole = _as_whole(scan, readings, search, best) if _may_be_whole(best.candidates, options) else None
    return Tried(best, tuple(tried), _visibility(best.candidates, context, options), whole)


def align(tried: Tried, context: Context, options: FitOptions) -> Tried:
    """Turn the best hypothesis by the small yaw that its undeformed candidates still lack, unless the pose is given."""
    if options.known or options.pose is not None:
        return tried
    yaw = _missing_yaw(tried.best.candidates, tried.visibility)
    if abs(yaw) < MIN_YAW:
        return tried
    turn = yaw_rotation(-yaw)
    frame = replace(tried.best.frame, rotation=turn @ tried.best.frame.rotation)
    best = replace(tried.best, frame=frame, candidates=tried.best.candidates.rotated(torch.from_numpy(turn).float()))
    return Tried(best, tried.every, _visibility(best.candidates, context, options))


def _lacks_parts(scan: CleanScan, reading: PoseHypothesis, context: Context, options: FitOptions) -> bool:
    """Decide whether networks for partial scans encode this one: they do where anything is likely hidden."""
    if options.partial is not None:
        return options.partial
    floor = scan.floor
    if floor is not None and not options.known and is_truncated(scan.points, scan.up, floor):
        return True
    frame = initial_frame(scan.points, reading, options.known)
    cloud = torch.from_numpy(frame.to_unit(scan.points)).float()
    return lacks_parts(cloud, context.model, reading.category, options.known)


def _may_be_whole(candidates: Candidates, options: FitOptions) -> bool:
    """Check whether a scan that is expected to lack parts fills the known box of its whole object."""
    undecided = candidates.partial and options.partial is None and options.known and options.model_id is None
    return undecided and options.deform != "paper" and fills_unit_box(candidates.target)


def _as_whole(scan: CleanScan, readings: Sequence[PoseHypothesis], search: Search, best: Hypothesis) -> Candidates:
    """Retrieve the candidates of the best hypothesis' category as for a whole scan; the frame is known."""
    same = [reading for reading in readings if reading.category == best.category]
    return hypotheses(scan.points, same[:1], search, partial=False)[0].candidates


def _visibility(candidates: Candidates, context: Context, options: FitOptions) -> Visibility:
    if options.partial is False:
        return all_seen()
    return predicted(candidates, context.model)


def _missing_yaw(candidates: Candidates, visibility: Visibility) -> float:
    """Find the yaw (radians) by which the best of the first candidates, undeformed, lies closest to the scan."""
    goal = candidates.target.numpy()
    few = np.ascontiguousarray(goal[:: max(1, len(goal) // PLACED_POINTS)])
    apart = spacing(few)
    best, found = np.inf, 0.0
    for row in range(min(ALIGNED, len(candidates.model_ids))):
        points = candidates.points[row].numpy()
        some = np.ascontiguousarray(points[:: max(1, len(points) // PLACED_POINTS)])
        visible = visibility(some)
        straight = fit_placement(some, Placement.identity(), few, visible, per_axis=True, free_yaw=False, rounds=8)
        rotated = fit_placement(some, straight, few, visible, per_axis=True, free_yaw=True, rounds=8)
        errors = [
            distances(few, (apart, 0.0), np.ascontiguousarray(one(some), dtype=np.float32), visible).error
            for one in (straight, rotated)
        ]
        if errors[1] < min(best, YAW_GAIN * errors[0]):
            best, found = errors[1], rotated.yaw
    return found
