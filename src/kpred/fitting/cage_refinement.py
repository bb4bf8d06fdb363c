"""Cage refinement: after the keypoints, a finer cage of the best candidates is free itself.

Twelve keypoints move the source by a basis of twelve columns. What they leave is fitted by a lattice of control points
around the source (`kpred.ops.lattice`): S' = S + L D, from the source itself, with D of least squares to the scan
between nearest-neighbour updates, as stiff as furniture is: straight edges stay straight, boards flat, and the warp is
nearly mirror symmetric. The keypoints' result is where the matching starts, and holds the surface that a partial scan
does not show. The points are carried by the mesh's faces, so that the error is that of the mesh which is delivered.
"""

from __future__ import annotations

from dataclasses import replace
from functools import lru_cache

import numpy as np
import torch
from torch import Tensor

from kpred.database import Database
from kpred.fitting.cage_cpu import fitted_cage
from kpred.fitting.candidates import Candidates
from kpred.fitting.choice import order
from kpred.fitting.refine import ASKED_IN_TURN, unseen_share
from kpred.fitting.refine_config import RefineConfig
from kpred.fitting.surface_points import SurfacePoints, surface_points
from kpred.fitting.warp import Warp
from kpred.ops.lattice import SIZE, lattice_asymmetry, lattice_stiffness
from kpred.ops.nearest import nearest_neighbours
from kpred.ops.typing import Bool, Float
from kpred.ops.weighted_sums import LEAST_SCALE
from kpred.ops.worksharing import share_out

HELD = 5e-8
"""Weight of a control point's displacement, so that those far from any surface have one."""


def with_cages(
    candidates: Candidates, errors: Float[Tensor, " candidates"], database: Database, config: RefineConfig
) -> tuple[Candidates, Float[Tensor, " candidates"], Bool[Tensor, " candidates"]]:
    """The candidates, the best of them refined by a cage of their own; the errors of all; which of these have a cage.

    Args:
        candidates: after keypoint refinement; errors: theirs (`Candidates.errors`), estimates will do; database: that
            they are from.

    Of a full scan the `config.cage_finalists` of lowest error are refined, of a partial one that which is chosen: the
    others are what it was chosen by.

    Raises:
        DatabaseError: a candidate is no longer in the database.
    """
    if candidates.partial:
        rows = order(candidates, errors + candidates.free_space_errors())[:1]
    else:
        rows = errors.argsort(stable=True)[: config.cage_finalists].tolist()
    surfaces = [surface_points(database, candidates.model_ids[row], candidates.points[row]) for row in rows]
    moved, errors = candidates.deformed(), errors.clone()
    stiff = _stiffness(config.cage_smoothness, config.cage_symmetry).numpy()
    warps: list[Warp | None] = [None] * len(moved)
    result = moved.numpy().copy()

    def fit_some(first: int, last: int) -> None:
        for row, surface in zip(rows[first:last], surfaces[first:last], strict=True):
            warps[row], result[row] = _fitted(
                candidates.points[row], surface, moved[row], candidates.target, stiff, candidates.partial, config
            )

    share_out(fit_some, len(rows), len(rows) * config.cage_iterations * config.points**2)
    caged = replace(candidates, warps=tuple(warps), warped=torch.from_numpy(result))
    index = torch.tensor(rows)
    errors[index] = caged.errors_of(index)
    return caged, errors, torch.zeros(len(errors), dtype=torch.bool).index_fill(0, index, True)


def _fitted(
    source: Float[Tensor, "points 3"],
    surface: SurfacePoints,
    start: Float[Tensor, "points 3"],
    target: Float[Tensor, "target 3"],
    stiff: Float[np.ndarray, "3 controls controls"],
    partial: bool,
    config: RefineConfig,
) -> tuple[Warp, Float[np.ndarray, "points 3"]]:
    """A cage around one source, fitted, and where it takes the source's points; `start` is the keypoints' result."""
    half = torch.maximum(surface.vertices.abs().amax(0), source.abs().amax(0))
    columns = surface.lattice_columns(source, half)
    step, target_step = max(1, len(source) // config.points), max(1, len(target) // config.points)
    few, goal = start[::step].contiguous(), target[::target_step].contiguous()
    held = _unseen(few, goal, config.unseen) if partial else torch.zeros_like(few[:, 0])
    displacement = fitted_cage(
        columns.numpy()[::step],
        source.numpy()[::step],
        few.numpy(),
        held.numpy(),
        goal.numpy(),
        stiff,
        rounds=config.cage_iterations,
        asked_in_turn=ASKED_IN_TURN,
        robust=config.cage_robust**2,
        least=LEAST_SCALE,
        partial=partial,
    )
    return Warp(half, torch.from_numpy(displacement)), source.numpy() + columns.numpy() @ displacement


def _unseen(
    start: Float[Tensor, "points 3"], goal: Float[Tensor, "target 3"], weight: float
) -> Float[Tensor, " points"]:
    """Weights with which points stay where the keypoints put them: they are not seen."""
    squared, _ = nearest_neighbours(start[None], goal[None])
    return weight * unseen_share(squared[0]) / squared.shape[1]


@lru_cache(maxsize=8)
def _stiffness(smoothness: float, symmetry: float) -> Float[Tensor, "3 controls controls"]:
    """What holds the control points, for x, y and z."""
    held = HELD * torch.eye(SIZE**3, dtype=torch.float64)
    return smoothness * lattice_stiffness() + symmetry * lattice_asymmetry() + held
