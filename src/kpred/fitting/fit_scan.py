"""The main job: from a scan by way of retrieved, deformed and refined candidates to a CAD mesh in the scan's frame."""

from __future__ import annotations

import os
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import replace
from typing import Literal

import numpy as np
import torch
import trimesh

from kpred.database import Database, Entry
from kpred.errors import ConfigError
from kpred.fitting.cage_refinement import with_cages
from kpred.fitting.choice import ranking
from kpred.fitting.cleaning import CleanConfig, CleaningStep, clean_scan
from kpred.fitting.confidence import category_probabilities, confidence, evidence_of
from kpred.fitting.hypotheses import Hypothesis, Search, hypotheses, looks_partial
from kpred.fitting.placement import check_known_frame, judged, placements, up_axis
from kpred.fitting.pose import PoseEstimator
from kpred.fitting.recognise import Reading
from kpred.fitting.refine_config import RefineConfig
from kpred.fitting.resources import as_database, as_model, shared_categories
from kpred.fitting.result import Candidate, Fit, Metric
from kpred.fitting.standing import feet_missing, stood_on
from kpred.fitting.warnings import warnings_of
from kpred.nn import Model
from kpred.ops.typing import Float
from kpred.shapes.scan import check_points, read_scan

MOST_POINTS = 50_000
"""Points of a scan that are cleaned; of a denser scan so many are taken at random."""

HOPELESS = 1e3
"""Above all errors, unit box squared."""

TOLD_POINTS, COMPARED_POINTS = 128, 512
"""Points by which errors are estimated that are told, but decide nothing; and those that decide who gets a cage."""

MOST_READINGS = 5
ODDS_RANGE = 5.0
"""So many readings of a scan are tried, unless their log-odds are this much below the best."""

SCAN_POINTS = 2048
"""Points of a scan that a fit uses (N_P of the paper); a denser scan is thinned."""


def fit(
    scan: str | os.PathLike[str] | np.ndarray,
    model: Model | str | os.PathLike[str] | None = None,
    database: Database | str | os.PathLike[str] | None = None,
    category: str | None = None,
    top_k: int = 10,
    frame: Literal["auto", "known"] = "auto",
    refine: bool = True,
    *,
    partial: bool | None = None,
    up: str = "auto",
    pose: PoseEstimator | str | None = None,
    clean: bool | CleanConfig = True,
    seed: int = 0,
    refinement: RefineConfig | None = None,
    sensor: np.ndarray | None = None,
    floor: float | None = None,
) -> Fit:
    """Find the CAD model that explains a scan of one object, and deform it to the scan.

    Args:
        scan: path of a point cloud or mesh, or points (N, 3) in any unit, at least 64 of them.
        model: trained networks, or their name or folder; None means bundled.
        database: open database or its path; None means bundled.
        category: search this category only; None tries all that model and database share.
        top_k: candidates retrieved by tokens, deformed and compared (paper: 10).
        frame: `auto` finds the scan's yaw and box; `known` takes the scan as canonical (y up, front +z) inside its
            whole object's unit box, which is the paper's protocol.
        refine: refine keypoints by least squares; False is the paper's protocol.
        partial: whether parts are missing; None finds out, and a scan that ends well above its floor lacks some.
        up: the scan's up axis, one of x, y, z, -x, -y, -z; `auto` finds it (ignored with `frame="known"`).
        pose: an estimator of the scan's rotation or its name (`identity`, `upright`, `given:FILE`); None tries the scan
            as it stands and turned about its up axis.
        clean: remove outliers, repeats, pieces of floor and wall, and even out the density first; with
            `frame="known"` only if settings are given.
        seed: of the sub-sampling of dense scans.
        refinement: settings of the refinement.
        sensor: (3,) or (S, 3) where the scanner stood, scan's frame; the result may not fill space it looked through.
        floor: height of the floor along the up axis, scan's frame and unit, where it is known: the object stands on it.

    Of a full scan's candidates the one of the lowest error is chosen; of those within 5 % of it, the one that had to be
    deformed least. Of a partial scan's the one whose whole surface is likely right (`kpred.fitting.choice`).

    Returns:
        The fit; `fit.mesh` is in the scan's own frame and units.

    Raises:
        ScanError: if the scan is missing, unreadable, degenerate or too small.
        ModelError, DatabaseError: if they are missing, or the database was made by other weights.
        ConfigError: if an argument has an impossible value.
    """
    if top_k < 1:
        raise ConfigError(f"top_k must be at least 1, but is {top_k}.")
    if frame not in ("auto", "known"):
        raise ConfigError(f"frame must be 'auto' or 'known', but is '{frame}'.")
    stood = None if sensor is None else _sensors(sensor)
    clock = _Clock()
    with clock("read"):
        name = "scan" if isinstance(scan, np.ndarray) else str(scan)
        cloud = scan if isinstance(scan, np.ndarray) else read_scan(scan, seed=seed)
        points = subsample(check_points(np.asarray(cloud, dtype=np.float64), name), MOST_POINTS, seed)
        scan_size = len(points)
    known = frame == "known"
    with clock("load"):
        networks, store = as_model(model), as_database(database)
        categories = shared_categories(networks, store, category)
    with clock("up"):
        up = "y" if known else up_axis(points, up, networks.recognizer)
    with clock("clean"):
        steps: tuple[CleaningStep, ...] = ()
        if isinstance(clean, CleanConfig) or (clean and not known):
            settings = clean if isinstance(clean, CleanConfig) else CleanConfig()
            cleaned = clean_scan(points, up, settings, seed=seed)
            points, steps = cleaned.points, cleaned.steps
            floor = cleaned.floor_height if floor is None else floor
        points = points[:SCAN_POINTS]
        if partial is None and floor is not None and not known and feet_missing(points, up, floor):
            partial = True
    with clock("frame"):
        if known:
            check_known_frame(points)
            readings = judged(points, [np.eye(3)], networks.recognizer, categories)
        else:
            readings = placements(points, up, pose, networks.recognizer, categories)
        readings = worth_trying(readings, networks.recognizer is not None)
    search = Search(networks, store, top_k, known, floor)
    with clock("retrieve"):
        # Whether a scan is partial is judged by the likeliest reading, or by all where nothing judged them.
        few = readings[:1] if partial is None and networks.recognizer is not None else readings
        tried = hypotheses(points, few, search, bool(partial))
    if partial is None:
        with clock("completeness"):
            partial = looks_partial(tried[0])
        if partial or len(few) < len(readings):
            with clock("retrieve"):
                tried = hypotheses(points, readings, search, partial, before=tried)
    chosen = tried[0]
    if stood is not None:
        sensors = torch.from_numpy(chosen.frame.to_unit(stood)).float()
        chosen = replace(chosen, candidates=replace(chosen.candidates, sensors=sensors))
    with clock("deform"):
        # Where they are refined, what they were before is only told.
        if refine:
            errors = chosen.candidates.errors(TOLD_POINTS)
        else:
            errors, exact = chosen.candidates.closest_errors()
    feed_forward, judged_by, before = errors, chosen, chosen
    if refine:
        with clock("refine"):
            refinement = refinement or RefineConfig()
            has_cage = refinement.has_cage(bool(partial))
            refined = chosen.candidates.refined(refinement)
            if has_cage and not partial:
                errors = refined.errors(COMPARED_POINTS)
            else:
                errors, exact = refined.closest_errors()
        # A cage brings a wrong model nearly as close as the right one: it is the keypoints' fit that tells them apart.
        judged_by = replace(chosen, candidates=refined)
        with clock("cage"):
            if has_cage:
                refined, errors, exact = with_cages(refined, errors, store, refinement)
        chosen = replace(chosen, candidates=refined)
    with clock("choose"):
        # Those that refinement gave up come last, the least bad first.
        ranked = torch.where(errors.isinf(), HOPELESS + feed_forward, errors)
        order = ranking(chosen.candidates, ranked + chosen.candidates.free_space_errors(), exact)
    with clock("mesh"):
        squared = chosen.candidates.from_scan(order[0])
        if partial:
            errors[order[0]] = squared.mean()
        if refine:
            feed_forward[order[0]] = before.candidates.errors_of(torch.tensor(order[:1]))[0]
        candidates = _candidates(chosen, feed_forward, errors if refine else None, order)
        entry = store.entry(candidates[0].model_id)
        meshes, keypoints = _placed(chosen, entry, order[0])
        metrics = _metrics(chosen, candidates[0], squared, known)
        if partial and floor is not None and not known:
            up_direction = chosen.frame.rotation[1]
            lowest = float((meshes[0].vertices @ up_direction).min())
            keypoints = stood_on(keypoints, lowest, points, up_direction, floor)
            meshes[0].vertices = stood_on(np.asarray(meshes[0].vertices), lowest, points, up_direction, floor)
    with clock("confidence"):
        evidence = evidence_of(judged_by, order[0], tried, networks.recognizer is not None)
        sure, of_categories = confidence(evidence), category_probabilities(tried)
    return Fit(
        mesh=meshes[0],
        retrieved_mesh=meshes[1],
        source=candidates[0],
        candidates=candidates,
        frame=chosen.frame,
        keypoints=keypoints,
        keypoint_confidence=chosen.candidates.confidence.numpy(),
        confidence=sure,
        category_confidence=of_categories,
        category_errors=_category_errors(tried),
        cleaning=steps,
        partial=bool(partial),
        refined=refine,
        frame_known=known,
        metrics=metrics,
        timings=clock.seconds,
        warnings=warnings_of(evidence, sure, chosen.category, of_categories, steps, scan_size),
        evidence=evidence,
    )


def worth_trying(readings: Sequence[Reading], are_judged: bool) -> list[Reading]:
    """Of readings by falling odds those that may still turn out best; all of them where nothing judged them."""
    if not are_judged:
        return list(readings)
    return [reading for reading in readings[:MOST_READINGS] if reading.log_odds > readings[0].log_odds - ODDS_RANGE]


class _Clock:
    """Seconds spent in named steps."""

    def __init__(self) -> None:
        self.seconds: dict[str, float] = {}

    @contextmanager
    def __call__(self, name: str) -> Iterator[None]:
        started = time.perf_counter()
        try:
            yield
        finally:
            self.seconds[name] = self.seconds.get(name, 0.0) + time.perf_counter() - started


def _sensors(sensor: np.ndarray) -> np.ndarray:
    """Places (S, 3) where the scanner stood, of one or several."""
    places = np.atleast_2d(np.asarray(sensor, dtype=np.float64))
    if places.ndim != 2 or places.shape[1] != 3 or not len(places) or not np.isfinite(places).all():
        raise ConfigError(f"sensor must be one or several places of 3 finite numbers each, but is {sensor}.")
    return places


def subsample(points: np.ndarray, most: int, seed: int) -> np.ndarray:
    """At most `most` points, in random order, so that the first ones are a fair sample too."""
    return points[np.random.default_rng(seed).permutation(len(points))[:most]]


def _candidates(
    chosen: Hypothesis, feed_forward: torch.Tensor, refined: torch.Tensor | None, order: list[int]
) -> tuple[Candidate, ...]:
    found = chosen.candidates
    return tuple(
        Candidate(
            model_id=found.model_ids[row],
            category=found.category,
            distance=float(found.distances[row]),
            error=float(feed_forward[row]),
            refined_error=None if refined is None or refined[row].isinf() else float(refined[row]),
            displacement=found.displacement[row].numpy(),
        )
        for row in order
    )


def _category_errors(tried: Sequence[Hypothesis]) -> dict[str, float]:
    errors: dict[str, float] = {}
    for one in tried:
        errors.setdefault(one.category, one.error)
    return errors


def _placed(
    chosen: Hypothesis, entry: Entry, row: int
) -> tuple[tuple[trimesh.Trimesh, trimesh.Trimesh], Float[np.ndarray, "keypoints 3"]]:
    """The deformed mesh and the retrieved one, and the deformed keypoints, in the scan's frame and units."""
    vertices = entry.frame.to_unit(entry.mesh.vertices.astype(np.float64))
    points = np.concatenate([vertices, entry.keypoints.astype(np.float64)])
    basis = np.concatenate([entry.vertex_basis.astype(np.float64), np.eye(len(entry.keypoints))])
    place = chosen.frame.from_unit
    moved = place(chosen.candidates.result_of(row, points, basis))
    meshes = (
        trimesh.Trimesh(moved[: len(vertices)], entry.mesh.faces.copy(), process=False),
        trimesh.Trimesh(place(vertices), entry.mesh.faces.copy(), process=False),
    )
    return meshes, moved[len(vertices) :]


def _metrics(chosen: Hypothesis, best: Candidate, squared: torch.Tensor, known: bool) -> tuple[Metric, ...]:
    kind = "unilateral_chamfer_distance" if chosen.candidates.partial else "chamfer_distance"
    box = "known unit box" if known else "estimated unit box"
    mean = float(squared.sqrt().mean()) * chosen.frame.scale
    return (
        Metric(kind, best.final_error, "unit box squared", box),
        Metric("mean_scan_to_result", mean, "scan units", "scan"),
    )
