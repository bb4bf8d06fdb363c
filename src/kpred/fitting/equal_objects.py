"""Equal things of a room share one model and its deformation, where their scans agree with it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import torch
from scipy.spatial import cKDTree

from kpred.fitting.object_fit import ObjectFit
from kpred.fitting.result import Fit
from kpred.ops.rotations import upright_rotation, yaw_rotation
from kpred.ops.sampling import sample_surface
from kpred.ops.typing import Float

MAX_WORSE, MAX_FARTHER = 1.25, 0.004
"""A shared model may be this many times, and so many metres, farther from a scan than the object's own model."""

MAX_APART = 0.04
"""Metres, in the mean over both surfaces, between an object's own model and one that it may share."""

MAX_SIZE_RATIO = 1.2
"""Between the sides of the two models' boxes; where a scan shows half of an object its own model is a guess."""

TURNS = np.radians([0.0, 90.0, 180.0, 270.0])
SURFACE_POINTS, SCAN_POINTS, STEPS = 2500, 700, 15


@dataclass(frozen=True, eq=False)
class _Result:
    """A result in metres, y up: points (P, 3) of its surface, of its scan (S, 3), and its front's yaw in radians."""

    surface: Float[np.ndarray, "points 3"]
    scan: Float[np.ndarray, "scan 3"]
    yaw: float

    @property
    def middle(self) -> Float[np.ndarray, "3"]:
        return np.asarray((self.surface.min(axis=0) + self.surface.max(axis=0)) / 2)


def share_models(fits: Sequence[ObjectFit], up: str, metres: float) -> list[ObjectFit]:
    """Give equal objects of a level room the model of the surest of them, each in its own place.

    Args:
        up: the room's up axis; metres: length of its unit.
    """
    turn = upright_rotation(up) * metres
    order = sorted((row for row, item in enumerate(fits) if item.fit is not None), key=lambda row: -_weight(fits[row]))
    results = {row: _result(fits[row], turn) for row in order}
    shared = list(fits)
    for number, leader in enumerate(order):
        if shared[leader].shares is not None:
            continue
        for row in order[number + 1 :]:
            if shared[row].shares is None and _category(fits[row]) == _category(fits[leader]):
                motion = _motion(results[leader], results[row])
                if motion is not None:
                    shared[row] = _with_model(fits[row], fits[leader], motion, turn)
    return shared


def _weight(item: ObjectFit) -> float:
    """Return how sure a result is, and how much of it its scan shows."""
    assert item.fit is not None
    return item.fit.confidence * (1.0 if item.object.score is None else item.object.score) * item.fit.seen


def _category(item: ObjectFit) -> str:
    assert item.fit is not None
    return item.fit.category


def _result(item: ObjectFit, turn: np.ndarray) -> _Result:
    assert item.fit is not None
    vertices = torch.from_numpy(np.asarray(item.fit.mesh.vertices, dtype=np.float64) @ turn.T)
    faces = torch.from_numpy(np.asarray(item.fit.mesh.faces, dtype=np.int64))
    surface = sample_surface(vertices, faces, SURFACE_POINTS, torch.Generator().manual_seed(0))[0].numpy()
    points = item.fit.points[:: max(1, len(item.fit.points) // SCAN_POINTS)] @ turn.T
    front = turn @ item.fit.frame.rotation[2]
    return _Result(surface, points, float(np.arctan2(front[0], front[2])))


def _motion(model: _Result, item: _Result) -> tuple[float, np.ndarray] | None:
    """Find the yaw and the step (3,), metres, that take a model onto an object's scan; None if they are not equal."""
    own = cKDTree(item.surface)
    limit = MAX_WORSE * float(own.query(item.scan)[0].mean()) + MAX_FARTHER
    best: tuple[float, float, np.ndarray] | None = None
    for extra in TURNS:
        yaw, step, distance = _register(model, item, item.yaw - model.yaw + float(extra))
        if best is None or distance < best[0]:
            best = distance, yaw, step
    assert best is not None
    distance, yaw, step = best
    if distance > limit:
        return None
    moved = model.surface @ yaw_rotation(yaw).T + step
    sides = np.ptp(moved, axis=0) / np.maximum(np.ptp(item.surface, axis=0), 1e-6)
    if sides.max() > MAX_SIZE_RATIO or sides.min() < 1.0 / MAX_SIZE_RATIO:
        return None
    apart = (float(own.query(moved)[0].mean()) + float(cKDTree(moved).query(item.surface)[0].mean())) / 2
    return (yaw, step) if apart <= MAX_APART else None


def _register(model: _Result, item: _Result, start: float) -> tuple[float, np.ndarray, float]:
    """Move a model in plan, from a yaw on, until its surface is nearest to a scan; yaw, step (3,), mean distance."""
    tree = cKDTree(model.surface)
    yaw = start
    step = item.middle - yaw_rotation(yaw) @ model.middle
    step[1] = item.surface[:, 1].min() - model.surface[:, 1].min()
    distance = np.zeros(0)
    for _ in range(STEPS):
        local = (item.scan - step) @ yaw_rotation(yaw)
        distance, index = tree.query(local)
        near = distance <= np.quantile(distance, 0.9)
        target, source = local[near][:, [0, 2]], model.surface[index[near]][:, [0, 2]]
        # The turn about the up axis and the step in plan with the least squared distance.
        one, other = source - source.mean(axis=0), target - target.mean(axis=0)
        sine, cosine = (one[:, 1] * other[:, 0] - one[:, 0] * other[:, 1]).sum(), (one * other).sum()
        angle = float(np.arctan2(sine, cosine))
        change = np.zeros(3)
        turned = yaw_rotation(angle)
        middle = np.array([source[:, 0].mean(), 0.0, source[:, 1].mean()])
        change[[0, 2]] = target.mean(axis=0) - (turned @ middle)[[0, 2]]
        step = step + yaw_rotation(yaw) @ change
        yaw += angle
        if abs(angle) < 1e-3 and np.linalg.norm(change) < 1e-3:
            break
    return yaw, step, float(distance.mean())


def _with_model(item: ObjectFit, leader: ObjectFit, motion: tuple[float, np.ndarray], turn: np.ndarray) -> ObjectFit:
    """Return an object's result with the leader's model, moved by a yaw and a step (metres, y up)."""
    assert item.fit is not None and leader.fit is not None
    yaw, step = motion
    inverse = np.linalg.inv(turn)
    turned = leader.rotated(inverse @ yaw_rotation(yaw) @ turn).moved(inverse @ step).fit
    assert turned is not None
    return replace(item, fit=_of_scan(turned, item.fit), shares=leader.object.name)


def _of_scan(model: Fit, own: Fit) -> Fit:
    """Return a fit's model with all that another fit says of its own scan."""
    return replace(
        model,
        points=own.points,
        confidence=own.confidence,
        category_confidence=own.category_confidence,
        category_errors=own.category_errors,
        cleaning=own.cleaning,
        partial=own.partial,
        seen=own.seen,
        metrics=own.metrics,
        timings=own.timings,
        evidence=own.evidence,
        warnings=own.warnings,
        source_data=own.source_data,
    )
