"""Results of a room put together: no two of one thing, none in the floor or above it, none in what else is seen."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from kpred.fitting.object_fit import ObjectFit
from kpred.fitting.seen_surface import SeenSurface, deep_cells, owners
from kpred.ops.rotations import upright_rotation
from kpred.ops.solid_cells import CELL, shared_cells, solid_cells
from kpred.ops.typing import Float, Int
from kpred.scenes.floor import SceneFloor

DUPLICATE = 0.35
"""Two results that share more of the smaller one's volume, or boxes that overlap by this IoU, are of one thing."""

MAX_SHARED = 0.005
"""Fraction of the smaller one's volume that two results may share."""

MAX_INSIDE = 0.03
"""Square metres of other things' scanned surface that may lie deep in a result."""

MAX_MOVE = 0.14
"""Metres by which a result is moved at most to part it from others."""

MAX_FLOOR_GAP = 0.08
"""Metres by which a result is raised or lowered at most to stand on the floor."""


@dataclass(frozen=True, eq=False)
class _Solid:
    """A result in metres, y up: its cells (C, 3), those deep inside (D, 3), the corners (2, 3) of its box."""

    cells: Int[np.ndarray, "cells 3"]
    deep: Int[np.ndarray, "deep 3"]
    box: Float[np.ndarray, "2 3"]

    def moved(self, step: Int[np.ndarray, "3"]) -> _Solid:
        return _Solid(self.cells + step, self.deep + step, self.box + step * CELL)

    def trouble(self, others: Sequence[_Solid], seen: Int[np.ndarray, "cells 3"]) -> float:
        """Return how much it shares with others and with seen surface, 1 for as much as it may."""
        shared = max((self.shares(other) for other in others), default=0.0)
        return max(shared / MAX_SHARED, shared_cells(self.deep, seen) * CELL**2 / MAX_INSIDE)

    def shares(self, other: _Solid) -> float:
        """Return the shared volume as a fraction of the smaller one's."""
        return shared_cells(self.cells, other.cells) / max(min(len(self.cells), len(other.cells)), 1)


def arrange(
    fits: Sequence[ObjectFit],
    up: str,
    floor: SceneFloor | None,
    metres: float,
    points: Float[np.ndarray, "points 3"] | None = None,
) -> list[ObjectFit]:
    """Put the results of a level room together, in the given order.

    Those that stand on the floor are set on it; of two of one thing the less sure one is dropped; the less sure ones
    are moved sideways by up to `MAX_MOVE` until they share next to no volume with surer ones, nor with what else is
    seen: where a surface was scanned, a camera saw empty space.

    Args:
        up: the room's up axis; metres: length of its unit; points: (N, 3) of its scan, level.
    """
    turn = upright_rotation(up) * metres
    order = sorted(
        (row for row, item in enumerate(fits) if item.fit is not None), key=lambda row: -_certainty(fits[row])
    )
    result = list(fits)
    placed: list[tuple[int, _Solid]] = []
    seen = None if points is None else _seen(fits, points, floor, turn)
    for row in order:
        item = _on_floor(fits[row], floor, turn)
        solid = _solid(item, turn)
        twin = next((other for other, there in placed if _is_twin(solid, there)), None)
        if twin is not None:
            why = f"{item.object.name}: it is the same thing as {fits[twin].object.name}, which fits better."
            result[row] = replace(item, fit=None, error=why)
            continue
        nothing = np.zeros((0, 3), dtype=np.int64)
        others = nothing if seen is None else seen.around(row, solid.box, MAX_MOVE)
        step = _parting_step(solid, [there for _, there in placed], others)
        if step.any():
            item = item.moved(np.linalg.solve(turn, step * CELL))
            solid = solid.moved(step)
        result[row] = item
        placed.append((row, solid))
    return result


def interpenetration(fits: Sequence[ObjectFit], up: str, metres: float) -> float:
    """Measure the volume that results share with others, as a fraction of their joint volume."""
    solids = [_solid(item, upright_rotation(up) * metres) for item in fits if item.fit is not None]
    total = sum(len(solid.cells) for solid in solids)
    shared = sum(shared_cells(one.cells, other.cells) for row, one in enumerate(solids) for other in solids[row + 1 :])
    return shared / max(total, 1)


def floor_gap(item: ObjectFit, up: str, metres: float) -> float | None:
    """Measure how far the lowest point of a result that stands on the floor is above it, metres; None for others."""
    if item.fit is None or item.floor is None:
        return None
    lowest = float((np.asarray(item.fit.mesh.vertices) @ upright_rotation(up).T)[:, 1].min())
    return (lowest - item.floor) * metres


def _certainty(item: ObjectFit) -> float:
    assert item.fit is not None
    return item.fit.confidence * (1.0 if item.object.score is None else item.object.score)


def _on_floor(item: ObjectFit, floor: SceneFloor | None, turn: np.ndarray) -> ObjectFit:
    """Raise or lower a result that stands on the floor so that it touches it, if it is near."""
    assert item.fit is not None
    if floor is None or item.floor is None:
        return item
    metres = float(np.linalg.norm(turn[0]))
    lowest = float((np.asarray(item.fit.mesh.vertices) @ turn.T)[:, 1].min())
    gap = lowest - item.floor * metres
    if abs(gap) > MAX_FLOOR_GAP:
        return item
    return item.moved(np.linalg.solve(turn, [0.0, -gap, 0.0]))


def _solid(item: ObjectFit, turn: np.ndarray) -> _Solid:
    assert item.fit is not None
    vertices = np.asarray(item.fit.mesh.vertices, dtype=np.float64) @ turn.T
    cells = solid_cells(vertices, np.asarray(item.fit.mesh.faces), CELL)
    return _Solid(cells, deep_cells(cells), np.stack([vertices.min(axis=0), vertices.max(axis=0)]))


def _is_twin(one: _Solid, other: _Solid) -> bool:
    shared = np.maximum(np.minimum(one.box[1], other.box[1]) - np.maximum(one.box[0], other.box[0]), 0.0).prod()
    volumes = [float(np.ptp(solid.box, axis=0).prod()) for solid in (one, other)]
    if shared > 0.5 * (sum(volumes) - shared):
        return True
    return bool(shared > 0) and one.shares(other) > DUPLICATE


def _parting_step(solid: _Solid, others: Sequence[_Solid], seen: Int[np.ndarray, "cells 3"]) -> Int[np.ndarray, "3"]:
    """Find the shortest step in plan, in cells, after which a result shares next to nothing; else the best one."""
    best = np.zeros(3, dtype=np.int64)
    least = solid.trouble(others, seen)
    if least <= 1.0:
        return best
    reach = int(MAX_MOVE / CELL)
    x, z = np.meshgrid(np.arange(-reach, reach + 1), np.arange(-reach, reach + 1), indexing="ij")
    steps = np.column_stack([x.ravel(), np.zeros(x.size, np.int64), z.ravel()])
    length = np.linalg.norm(steps, axis=1)
    for step in steps[np.argsort(length, kind="stable")]:
        if not 0 < np.linalg.norm(step) <= reach or (np.abs(step).sum() % 2 and np.abs(step).sum() > 3):
            continue
        trouble = solid.moved(step).trouble(others, seen)
        if trouble <= 1.0:
            return np.asarray(step)
        if trouble < 0.7 * least:
            best, least = step, trouble
    return best


def _seen(fits: Sequence[ObjectFit], points: np.ndarray, floor: SceneFloor | None, turn: np.ndarray) -> SeenSurface:
    of = owners(len(points), [item.object.indices for item in fits])
    metres = float(np.linalg.norm(turn[0]))
    return SeenSurface(points @ turn.T, of, None if floor is None else floor.level * metres)
