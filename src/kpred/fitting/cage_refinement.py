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

import torch
from torch import Tensor

from kpred.database import Database
from kpred.fitting.cage_cpu import match, newton_rounds
from kpred.fitting.candidates import Candidates
from kpred.fitting.choice import order
from kpred.fitting.refine import ASKED_IN_TURN, unseen_share
from kpred.fitting.refine_config import RefineConfig
from kpred.fitting.surface_points import SurfacePoints, surface_points
from kpred.fitting.warp import Warp
from kpred.ops.lattice import SIZE, lattice_asymmetry, lattice_stiffness
from kpred.ops.nearest import nearest_neighbours
from kpred.ops.typing import Float
from kpred.ops.weighted_sums import LEAST_SCALE, add_wanted

HELD = 5e-8
"""Weight of a control point's displacement, so that those far from any surface have one."""


def with_cages(
    candidates: Candidates, errors: Float[Tensor, " candidates"], database: Database, config: RefineConfig
) -> tuple[Candidates, Float[Tensor, " candidates"]]:
    """The candidates, the best of them refined by a cage of their own, and the errors of all.

    Args:
        candidates: after keypoint refinement; errors: theirs (`Candidates.errors`); database: that they are from.

    Of a full scan the `config.cage_finalists` of lowest error are refined, of a partial one that which is chosen: the
    others are what it was chosen by.

    Raises:
        DatabaseError: a candidate is no longer in the database.
    """
    if candidates.partial:
        rows = order(candidates, errors + candidates.free_space_errors())[:1]
    else:
        rows = errors.argsort(stable=True)[: config.cage_finalists].tolist()
    index = torch.tensor(rows)
    chosen = candidates.take(index)
    cages = [
        _Cage(points, surface_points(database, model_id, points))
        for points, model_id in zip(chosen.points, chosen.model_ids, strict=True)
    ]
    moved, errors = candidates.deformed(), errors.clone()
    displacement = _fitted(cages, moved[index], candidates.target, candidates.partial, config)
    warps: list[Warp | None] = [None] * len(moved)
    result = moved.clone()
    for row, cage, found in zip(rows, cages, displacement, strict=True):
        warps[row] = Warp(cage.half, found)
        result[row] = cage.points(found)
    caged = replace(candidates, warps=tuple(warps), warped=result)
    errors[index] = caged.take(index).errors()
    return caged, errors


class _Cage:
    """The lattice around one source, `source` (N, 3) in its unit box; `columns` (N, L) is what each control point does
    to each of the source's points, as the faces carry them.
    """

    def __init__(self, source: Tensor, surface: SurfacePoints) -> None:
        self.source = source
        self.half = torch.maximum(surface.vertices.abs().amax(0), source.abs().amax(0))
        self.columns = surface.lattice_columns(source, self.half)

    def points(self, displacement: Float[Tensor, "controls 3"]) -> Float[Tensor, "points 3"]:
        """All points of the source, moved."""
        return self.source + self.columns @ displacement


def _fitted(
    cages: list[_Cage],
    start: Float[Tensor, "cages points 3"],
    target: Float[Tensor, "target 3"],
    partial: bool,
    config: RefineConfig,
) -> Float[Tensor, "cages controls 3"]:
    """Displacements of the control points by least squares and matches in turn; `start` is the keypoints' result."""
    step = max(1, start.shape[1] // config.points)
    few = torch.stack([cage.source[::step] for cage in cages])
    columns = torch.stack([cage.columns[::step] for cage in cages])
    across = columns.transpose(1, 2).contiguous()
    goal = target[:: max(1, len(target) // config.points)].contiguous()
    stiff = _stiffness(config.cage_smoothness, config.cage_symmetry)
    start = start[:, ::step].contiguous()
    held = _unseen(start, goal, config.unseen) if partial else torch.zeros_like(start[..., 0])
    robust = config.cage_robust**2
    wanted = match(start.numpy(), goal.numpy(), 0, ASKED_IN_TURN, robust, LEAST_SCALE, partial)
    sums = torch.from_numpy(wanted)
    add_wanted(sums, start, held)
    normal = (across * sums[:, None, :, 3]) @ columns
    factor = torch.linalg.cholesky(normal.double()[:, None] + stiff).contiguous()
    displacement = newton_rounds(
        *(array.numpy() for array in (across, few, start, held, goal, sums, stiff, factor)),
        rounds=config.cage_iterations,
        asked_in_turn=ASKED_IN_TURN,
        robust=robust,
        least=LEAST_SCALE,
        partial=partial,
    )
    return torch.from_numpy(displacement)


def _unseen(start: Tensor, goal: Tensor, weight: float) -> Float[Tensor, "cages points"]:
    """Weights with which points stay where the keypoints put them: they are not seen."""
    squared, _ = nearest_neighbours(start, goal.expand(len(start), -1, -1))
    return weight * unseen_share(squared) / squared.shape[1]


@lru_cache(maxsize=8)
def _stiffness(smoothness: float, symmetry: float) -> Float[Tensor, "3 controls controls"]:
    """What holds the control points, for x, y and z."""
    held = HELD * torch.eye(SIZE**3, dtype=torch.float64)
    return smoothness * lattice_stiffness() + symmetry * lattice_asymmetry() + held
