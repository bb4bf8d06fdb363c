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
from kpred.fitting.candidates import Candidates
from kpred.fitting.choice import order
from kpred.fitting.refine import unseen_share
from kpred.fitting.refine_config import RefineConfig
from kpred.fitting.surface_points import SurfacePoints, surface_points
from kpred.fitting.warp import Warp
from kpred.ops.lattice import SIZE, lattice_asymmetry, lattice_stiffness, lattice_weights
from kpred.ops.nearest import nearest_neighbours
from kpred.ops.typing import Float

HELD = 5e-8
"""Weight of a control point's displacement, so that those far from any surface have one."""

FACTORED = (0, 2)
"""Rounds in which the normal matrix is made anew: between them matches change little, and the gradient is exact."""


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
    moved, errors = candidates.deformed(), errors.clone()
    warps: list[Warp | None] = [None] * len(moved)
    result = moved.clone()
    for row in rows:
        surface = surface_points(database, candidates.model_ids[row], candidates.points[row])
        cage = _Cage(candidates.points[row], surface, moved[row], candidates.target, candidates.partial, config)
        warps[row] = cage.fitted()
        result[row] = cage.points()
    caged = replace(candidates, warps=tuple(warps), warped=result)
    index = torch.tensor(rows)
    errors[index] = caged.take(index).errors()
    return caged, errors


class _Cage:
    """The lattice of one candidate; all in the unit box.

    `source` (N, 3), `moved` (N, 3) where the keypoints put it, `target` (M, 3).
    """

    def __init__(
        self,
        source: Tensor,
        surface: SurfacePoints,
        moved: Tensor,
        target: Tensor,
        partial: bool,
        config: RefineConfig,
    ) -> None:
        self.source, self.surface, self.config, self.partial = source, surface, config, partial
        self.half = torch.maximum(surface.vertices.abs().amax(0), source.abs().amax(0))
        self.at_vertices = None if surface.corners is None else lattice_weights(surface.vertices, -self.half, self.half)
        step = max(1, len(source) // config.points)
        self.few = source[::step]
        self.columns = self._columns(step)
        self.goal = target[:: max(1, len(target) // config.points)][None].contiguous()
        self.start = moved[::step]
        # Only the matches of the first round are those of the keypoints' result.
        self.displacement = source.new_zeros(SIZE**3, 3)

    def _columns(self, step: int) -> Tensor:
        if self.at_vertices is None:
            return lattice_weights(self.source[::step], -self.half, self.half)
        return self.surface.carried(self.at_vertices, step)

    def points(self) -> Float[Tensor, "points 3"]:
        """All points of the source, moved."""
        if self.at_vertices is None:
            return self.source + self._columns(1) @ self.displacement
        return self.source + self.surface.carried(self.at_vertices @ self.displacement)

    def fitted(self) -> Warp:
        """Least squares and matches in turn."""
        stiff = _stiffness(self.config.cage_smoothness, self.config.cage_symmetry)
        held = self._unseen()
        moved, factor = self.start, torch.empty(0)
        across = self.columns.T.contiguous()
        for step in range(self.config.cage_iterations):
            weight, wanted = self._matches(moved[None])
            weight, wanted = weight + held, wanted + held[:, None] * self.start
            if step in FACTORED:
                normal = across @ (self.columns * weight[:, None])
                factor = torch.linalg.cholesky(normal.double() + stiff)
            # Newton's step with a matrix that may be a round old.
            now = moved if step else self.few
            pull = ((wanted - weight[:, None] * now).T @ self.columns).double()[..., None]
            pull = pull - stiff @ self.displacement.double().T[..., None]
            found = torch.cholesky_solve(pull, factor)[..., 0].T
            self.displacement = self.displacement + found.to(self.displacement.dtype)
            moved = self.few + (self.displacement.T @ across).T
        return Warp(self.half, self.displacement)

    def _matches(self, moved: Tensor) -> tuple[Tensor, Tensor]:
        """Weight (N,) of what is wanted of each point, and the sum (N, 3) of where, by weight."""
        squared, index = nearest_neighbours(self.goal, moved)
        share = self._robust(squared[0]) / len(squared[0])
        weight = torch.zeros_like(moved[0, :, 0]).scatter_add_(0, index[0], share)
        wanted = torch.zeros_like(moved[0]).index_add_(0, index[0], self.goal[0] * share[:, None])
        if self.partial:
            return weight, wanted
        squared, index = nearest_neighbours(moved, self.goal)
        share = self._robust(squared[0]) / len(squared[0])
        return weight + share, wanted + self.goal[0, index[0]] * share[:, None]

    def _robust(self, squared: Tensor) -> Tensor:
        if self.config.cage_robust <= 0:
            return torch.ones_like(squared)
        scale = squared.median() * self.config.cage_robust**2 + 1e-4
        return (scale / (scale + squared)).square()

    def _unseen(self) -> Tensor:
        """Weight (N,) with which points stay where the keypoints put them: they are not seen."""
        if not self.partial:
            return torch.zeros_like(self.few[:, 0])
        squared, _ = nearest_neighbours(self.start[None], self.goal)
        return self.config.unseen * unseen_share(squared[0]) / len(squared[0])


@lru_cache(maxsize=8)
def _stiffness(smoothness: float, symmetry: float) -> Float[Tensor, "3 controls controls"]:
    """What holds the control points, for x, y and z."""
    held = HELD * torch.eye(SIZE**3, dtype=torch.float64)
    return smoothness * lattice_stiffness() + symmetry * lattice_asymmetry() + held
