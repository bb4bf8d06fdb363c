"""The main job: from a scan by way of retrieved, deformed and refined candidates to a CAD mesh in the scan's frame."""

from __future__ import annotations

import os
import time
from collections.abc import Iterator
from contextlib import contextmanager
from functools import lru_cache
from importlib import resources
from pathlib import Path
from typing import Literal

import numpy as np
import torch
import trimesh

from kpred.database import Database
from kpred.errors import ConfigError, DatabaseError
from kpred.fitting.candidates import Candidates, retrieve
from kpred.fitting.observation import observe
from kpred.fitting.placement import frame_hypotheses, known_frame
from kpred.fitting.refine import RefineConfig
from kpred.fitting.result import Candidate, Fit, Metric
from kpred.nn import Model, load_model
from kpred.ops.frames import Frame
from kpred.shapes.scan import check_points, read_scan

SCAN_POINTS = 2048
"""Points of a scan that a fit uses (N_P of the paper); a denser scan is sub-sampled at random."""

SCREEN = RefineConfig(iterations=3, points=256, prior=0.05)
"""Quick refinement by which hypotheses of category and yaw are compared."""

SCREENED = 3
"""Candidates of each hypothesis that are screened."""

UNSEEN_DISTANCE = 0.15
UNSEEN_SHARE = 0.12
"""A scan is taken as partial if more than this share of the best full-shape result is farther than this from it."""


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
    up: str = "y",
    seed: int = 0,
    refinement: RefineConfig | None = None,
) -> Fit:
    """Find the CAD model that explains a scan of one object, and deform it to the scan.

    Args:
        scan: path of a point cloud or mesh, or points (N, 3) in any unit, at least 64 of them.
        model: trained networks, or their name or folder; None means bundled.
        database: open database or its path; None means bundled.
        category: search this category only; None tries all that model and database share.
        top_k: candidates retrieved by tokens, deformed and compared (paper: 10).
        frame: `auto` takes the scan's own box and finds its yaw; `known` takes the scan as canonical (y up, front +z)
            inside its whole object's unit box, which is the paper's protocol.
        refine: refine keypoints by least squares; False is the paper's protocol.
        partial: whether parts of the object are missing; None finds out.
        up: the scan's up axis, one of x, y, z, -x, -y, -z (ignored with `frame="known"`).
        seed: of the sub-sampling of dense scans.
        refinement: settings of the refinement.

    Returns:
        The fit; `fit.mesh` is in the scan's own frame and units.

    Raises:
        ScanError: if the scan is missing, unreadable, degenerate or too small.
        ModelError, DatabaseError: if they are missing, or the database was made by other weights.
        ConfigError: if an argument has an impossible value.
    """
    if top_k < 1:
        raise ConfigError(f"top_k must be at least 1, but is {top_k}.")
    clock = _Clock()
    with clock("read"):
        name = "scan" if isinstance(scan, np.ndarray) else str(scan)
        cloud = scan if isinstance(scan, np.ndarray) else read_scan(scan, seed=seed)
        points = _subsample(check_points(np.asarray(cloud, dtype=np.float64), name), seed)
    with clock("load"):
        networks = model if isinstance(model, Model) else _loaded_model(None if model is None else str(model))
        store = database if isinstance(database, Database) else _opened(None if database is None else str(database))
        categories = _categories(networks, store, category)
    with clock("frame"):
        frames = [known_frame(points)] if frame == "known" else frame_hypotheses(points, up)
        clouds = torch.stack([torch.from_numpy(f.to_unit(points)).float() for f in frames])
    as_partial = bool(partial)
    chosen, hypothesis = _choose(clouds, networks, store, categories, top_k, as_partial, clock)
    if partial is None and _looks_partial(chosen):
        as_partial = True
        chosen, hypothesis = _choose(clouds, networks, store, categories, top_k, as_partial, clock)
    with clock("deform"):
        feed_forward = chosen.errors()
    refined_errors = None
    if refine:
        with clock("refine"):
            chosen = chosen.refined(refinement or RefineConfig())
            refined_errors = chosen.errors()
    with clock("mesh"):
        return _result(chosen, feed_forward, refined_errors, frames[hypothesis], points, store, frame == "known", clock)


def bundled_database_path() -> Path:
    """The starter database that comes with the package."""
    return Path(str(resources.files("kpred"))) / "bundled" / "furniture.kpred"


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


@lru_cache(maxsize=4)
def _loaded_model(name: str | None) -> Model:
    return load_model(name)


@lru_cache(maxsize=4)
def _opened(path: str | None) -> Database:
    if path is not None:
        return Database.open(path)
    bundled = bundled_database_path()
    if not bundled.is_file():
        raise DatabaseError(f"The bundled database {bundled} is missing; reinstall kpred or give --database.")
    return Database.open(bundled, read_only=True)


@lru_cache(maxsize=64)
def _checked(model: Model, database: Database) -> None:
    database.check_model(model)


def _categories(model: Model, database: Database, category: str | None) -> list[str]:
    _checked(model, database)
    if category is not None:
        model[category]
        return [category]
    return [name for name in model.categories if name in database.categories()]


def _subsample(points: np.ndarray, seed: int) -> np.ndarray:
    if len(points) <= SCAN_POINTS:
        return points
    rows = np.random.default_rng(seed).permutation(len(points))[:SCAN_POINTS]
    return points[rows]


def _choose(
    clouds: torch.Tensor,
    model: Model,
    database: Database,
    categories: list[str],
    top_k: int,
    partial: bool,
    clock: _Clock,
) -> tuple[Candidates, int]:
    """Candidates of the category and frame that explain the scan best after a quick refinement."""
    best: tuple[float, Candidates, int] | None = None
    for category in categories:
        with clock("encode"):
            observation = observe(clouds, model[category], partial)
        for hypothesis in range(len(clouds)):
            with clock("retrieve"):
                found = retrieve(observation, hypothesis, database, category, top_k, partial)
            error = 0.0
            if len(clouds) * len(categories) > 1:
                with clock("choose"):
                    order = found.errors(most=256).argsort()[:SCREENED]
                    error = float(found.refined(SCREEN, order).errors(most=512).min())
            if best is None or error < best[0]:
                best = (error, found, hypothesis)
    assert best is not None
    return best[1], best[2]


def _looks_partial(candidates: Candidates) -> bool:
    order = candidates.errors(most=512).argsort()[:SCREENED]
    close = candidates.refined(SCREEN, order)
    best = close.take(close.errors(most=512).argmin()[None])
    from kpred.ops import nearest_neighbours

    squared, _ = nearest_neighbours(best.deformed()[:, ::2], best.target[None])
    return float((squared > UNSEEN_DISTANCE**2).float().mean()) > UNSEEN_SHARE


def _result(
    chosen: Candidates,
    feed_forward: torch.Tensor,
    refined: torch.Tensor | None,
    frame: Frame,
    points: np.ndarray,
    database: Database,
    frame_known: bool,
    clock: _Clock,
) -> Fit:
    final = feed_forward if refined is None else refined
    order = final.argsort().tolist()
    candidates = tuple(
        Candidate(
            model_id=chosen.model_ids[row],
            category=chosen.category,
            distance=float(chosen.distances[row]),
            error=float(feed_forward[row]),
            refined_error=None if refined is None else float(refined[row]),
            displacement=chosen.displacement[row].numpy(),
        )
        for row in order
    )
    best = candidates[0]
    entry = database.entry(best.model_id)
    unit_vertices = entry.frame.to_unit(entry.mesh.vertices.astype(np.float64))
    moved = unit_vertices + entry.vertex_basis.astype(np.float64) @ best.displacement.astype(np.float64)
    faces = entry.mesh.faces
    result = trimesh.Trimesh(frame.from_unit(moved), faces, process=False)
    retrieved = trimesh.Trimesh(frame.from_unit(unit_vertices), faces, process=False)
    squared = squared_to_result = None
    row = torch.tensor(order[:1])
    winner = chosen.take(row)
    from kpred.ops import nearest_neighbours

    squared, _ = nearest_neighbours(winner.target[None], winner.deformed())
    squared_to_result = float(squared.sqrt().mean()) * frame.scale
    kind = "unilateral_chamfer_distance" if chosen.partial else "chamfer_distance"
    box = "known unit box" if frame_known else "estimated unit box"
    metrics = (
        Metric(kind, best.final_error, "unit box squared", box),
        Metric("mean_scan_to_result", squared_to_result, "scan units", "scan"),
    )
    return Fit(
        mesh=result,
        retrieved_mesh=retrieved,
        source=best,
        candidates=candidates,
        frame=frame,
        keypoints=frame.from_unit((entry.keypoints + best.displacement).astype(np.float64)),
        confidence=chosen.confidence.numpy(),
        partial=chosen.partial,
        refined=refined is not None,
        frame_known=frame_known,
        metrics=metrics,
        timings=dict(clock.seconds),
    )
