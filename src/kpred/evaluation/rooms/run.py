"""Whole rooms measured: what is found of their furniture, and how the results stand together."""

from __future__ import annotations

import time
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np

from kpred.detection.detect import MIN_SCORE, detect_objects
from kpred.detection.networks import CATEGORIES
from kpred.detection.objects import detected_objects, level_scene
from kpred.errors import ScanError
from kpred.evaluation.database_source import Progress
from kpred.evaluation.header import provenance, versions
from kpred.evaluation.metrics.summary import ALL, Scope, Summary
from kpred.evaluation.rooms.labelled import LabelledRoom, labelled_rooms, true_objects
from kpred.evaluation.rooms.matching import Match, average_precision, counted, match_objects, right_rows
from kpred.evaluation.rooms.poses import aligned_rows
from kpred.evaluation.scans.outcome import FitSettings, known_values
from kpred.fitting.arrangement import floor_gap, interpenetration
from kpred.fitting.fit_room import fit_room
from kpred.fitting.object_fit import ObjectFit
from kpred.json_output import plain
from kpred.ops.closest_point import closest_points

IOUS = (0.25, 0.5)
CANDIDATE_SCORE = 0.05
"""Least score of the detections that average precision takes into account."""

SURFACE_POINTS = 400
ON_FLOOR = 0.01
"""Metres off the floor up to which a result stands on it."""


@dataclass(frozen=True)
class RoomOutcome:
    """What became of one room.

    Attributes:
        dataset, room: which; points: of its scan; shown: category of each of its true objects, by row.
        matches: detected objects, the surest first; candidates: the same and less sure ones, for average precision.
        posed: rows of the objects whose pose is known; aligned: of those that a result meets (Scan2CAD's criterion);
            None where nothing was fitted or no pose is known.
        distances: metres from an object's points to its result's surface, in the mean, for each result.
        interpenetration: volume that results share, as a fraction of theirs; off_floor: metres above the floor of each
            result that stands on it; None, and none, where nothing was fitted.
        seconds: of the whole run; failure: why there is no result.
    """

    dataset: str
    room: str
    points: int
    shown: dict[int, str]
    matches: tuple[Match, ...] = ()
    candidates: tuple[Match, ...] = ()
    posed: dict[int, str] = field(default_factory=dict)
    aligned: tuple[int, ...] | None = None
    distances: tuple[float, ...] = ()
    interpenetration: float | None = None
    off_floor: tuple[float, ...] = ()
    seconds: float = 0.0
    failure: str | None = None


@dataclass(frozen=True, eq=False)
class RoomReport:
    """All that was measured: what it was made by, summaries, rooms one by one."""

    header: dict[str, Any]
    summaries: list[Summary] = field(default_factory=list)
    rooms: list[RoomOutcome] = field(default_factory=list)

    def to_json(self) -> dict[str, Any]:
        """Return plain values: header, rows, rooms."""
        rows = [row.to_json() for row in self.summaries]
        return {"header": self.header, "rows": rows, "rooms": [plain(room) for room in self.rooms]}


def evaluate_rooms(
    paths: Sequence[Path],
    settings: FitSettings,
    fits: bool = True,
    limit: int | None = None,
    progress: Progress | None = None,
) -> RoomReport:
    """Measure `kpred.fitting.fit_room.fit_room` on labelled rooms; without `fits`, the detection alone.

    Raises:
        ScanError, PackError: rooms are missing or damaged.
    """
    header = {
        **provenance(settings.model),
        "database": str(settings.database.path),
        "seed": settings.seed,
        "fitted": fits,
        "given": "nothing",
        "versions": versions(),
    }
    report = RoomReport(header)
    for path in paths:
        for room in labelled_rooms(path, limit):
            if progress is not None:
                progress(room.scene.name, len(report.rooms), len(report.rooms) + 1)
            report.rooms.append(_measured(room, settings, fits))
    for dataset in dict.fromkeys(room.dataset for room in report.rooms):
        report.summaries.extend(summarize(report.rooms, dataset, settings.seed))
    return report


def summarize(rooms: Iterable[RoomOutcome], dataset: str, seed: int) -> list[Summary]:
    """Summarize the rooms of a dataset: precision and recall by category, and measures of whole rooms."""
    mine = [room for room in rooms if room.dataset == dataset]
    found: list[Summary] = []
    for iou in IOUS:
        precision: dict[str, list[bool]] = {name: [] for name in CATEGORIES}
        recall: dict[str, list[bool]] = {name: [] for name in CATEGORIES}
        named: list[bool] = []
        for room in mine:
            right = right_rows(room.matches, iou)
            hit = {match.row for match, one in zip(room.matches, right, strict=True) if one}
            for name in CATEGORIES:
                precision[name] += counted(room.matches, right, name)
                recall[name] += [row in hit for row, category in room.shown.items() if category == name]
            located = right_rows(room.matches, iou, any_category=True)
            pairs = [match for match, one in zip(room.matches, located, strict=True) if one]
            named += [match.true == match.category for match in pairs if match.true in CATEGORIES]
        for name in (*CATEGORIES, ALL):
            scope = Scope(dataset, "all", name, seed)
            names = CATEGORIES if name == ALL else (name,)
            frame = f"points of the scan, IoU {iou}"
            found += scope.fraction("recall", [hit for one in names for hit in recall[one]], frame)
            found += scope.fraction("precision", [hit for one in names for hit in precision[one]], frame)
        found += Scope(dataset, "all", ALL, seed).fraction("category_right_of_located", named, f"IoU {iou}")
        candidates = [(room.candidates, right_rows(room.candidates, iou)) for room in mine]
        areas = [average_precision(candidates, name, len(recall[name])) for name in CATEGORIES if recall[name]]
        frame = f"points of the scan, IoU {iou}"
        found += Scope(dataset, "all", ALL, seed).mean("average_precision", areas, "1", frame, "mean of categories")
    every = Scope(dataset, "all", ALL, seed)
    for name in (*CATEGORIES, ALL):
        hits = [
            row in room.aligned
            for room in mine
            if room.aligned is not None
            for row, category in room.posed.items()
            if name in (category, ALL)
        ]
        found += Scope(dataset, "all", name, seed).fraction("aligned_20_cm_20_degrees_20_percent", hits, "scan")
    distances = [distance for room in mine for distance in room.distances]
    found += every.median("mean_scan_to_result", distances, "m", "scan")
    volume = "fraction of the results' volume"
    found += every.mean("interpenetration", known_values(mine, "interpenetration"), volume, "scan")
    gaps = [abs(gap) <= ON_FLOOR for room in mine for gap in room.off_floor]
    found += every.fraction("on_the_floor_within_1_cm", gaps, "results that stand on it")
    found += every.mean("time", [room.seconds for room in mine], "seconds a room", "wall clock")
    return found


def _measured(room: LabelledRoom, settings: FitSettings, fits: bool) -> RoomOutcome:
    """Measure one room; a room without furniture has the reason in place of results."""
    shown = true_objects(room)
    outcome = RoomOutcome(room.dataset, room.scene.name, len(room.scene.points), shown)
    started = time.perf_counter()
    detection = detect_objects(room.scene.points, min_score=CANDIDATE_SCORE)
    objects = detected_objects(level_scene(room.scene, detection), detection)
    candidates = tuple(match_objects(room, objects))
    kept = [item for item in objects if item.score is not None and item.score >= MIN_SCORE]
    matches = tuple(match_objects(room, kept))
    outcome = replace(outcome, candidates=candidates, matches=matches, seconds=time.perf_counter() - started)
    return _fitted(outcome, room, settings) if fits else outcome


def _fitted(outcome: RoomOutcome, room: LabelledRoom, settings: FitSettings) -> RoomOutcome:
    """Add what becomes of the room's furniture: of `matches` those that have a result."""
    started = time.perf_counter()
    try:
        result = fit_room(room.scene, settings.model, settings.database, top_k=settings.top_k)
    except ScanError as error:
        return replace(outcome, seconds=time.perf_counter() - started, failure=str(error))
    seconds = time.perf_counter() - started
    level = [item.rotated(result.leveling) for item in result.fitted]
    metres = 1.0 if result.floor is None else result.floor.metres
    gaps = [gap for item in level if (gap := floor_gap(item, result.scene.up, metres)) is not None]
    posed = {pose.row: pose.category for pose in room.poses if pose.row in outcome.shown}
    met = aligned_rows([pose for pose in room.poses if pose.row in posed], result.fitted)
    return replace(
        outcome,
        matches=tuple(match_objects(room, [item.object for item in result.fitted])),
        posed=posed,
        aligned=tuple(sorted(met)) if room.poses else None,
        distances=tuple(_distance(item) * metres for item in result.fitted),
        interpenetration=interpenetration(level, result.scene.up, metres),
        off_floor=tuple(gaps),
        seconds=seconds,
    )


def _distance(item: ObjectFit) -> float:
    """Measure the mean distance from the fitted points to the result's surface, scan's unit."""
    assert item.fit is not None
    points = item.fit.points[:: max(1, len(item.fit.points) // SURFACE_POINTS)]
    mesh = item.fit.mesh
    return float(closest_points(points, np.asarray(mesh.vertices, dtype=np.float64), np.asarray(mesh.faces))[0].mean())
