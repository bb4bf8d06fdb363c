"""Deform one model to a scan so that what makes it CAD stays: the structure-keeping fit."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np

from kpred.ops.typing import Float, Int
from kpred.refinement.freedom import (
    growth_limits,
    part_boxes,
    possible_bends,
    possible_leans,
    spline_slopes,
    spline_spans,
)
from kpred.refinement.part_points import PartPoints
from kpred.refinement.score import spacing
from kpred.refinement.score_cpu import squared_diagonal
from kpred.refinement.structure_apply_cpu import apply_columns
from kpred.refinement.structure_basis import StructureBasis, structure_basis
from kpred.refinement.structure_config import StructureConfig
from kpred.refinement.structure_cpu import fit_rounds
from kpred.refinement.thickness_cpu import hold_thickness
from kpred.shapes.structure import Structure

MIN_SCALE = 1e-4
"""Least squared distance that counts as one in robust weights, unit box."""

ALONG = 0.3
"""Weight of matches along the surface, where that of those across it is 1: samples say little about edges."""

THIN = 0.15
"""A part with a side shorter than this is a board or a bar, whose thickness is seen only from two sides; unit box."""

BLUR = 0.3
"""Boards thinner than this times the spacing of the scan's points keep their thickness; thicker ones may grow."""

OUTSIDE = 0.12
"""Surface is seen if a place so far outside of it is, unit box: the grid of visibility is no finer."""

STANDS = 0.02
"""Points of a part that stands on the floor are held there if they lie this close to its lowest, unit box."""


@dataclass(frozen=True, eq=False)
class StructureMap:
    """A deformation that keeps structure, of one model; from its unit box to the scan's.

    Attributes:
        basis: of the model; solution: (3, U) unknowns.
    """

    basis: StructureBasis
    solution: Float[np.ndarray, "3 unknowns"]

    def __call__(
        self, points: Float[np.ndarray, "points 3"], parts: Int[np.ndarray, " points"]
    ) -> Float[np.ndarray, "points 3"]:
        """Move points of the given parts."""
        return PartPoints(self.basis, points, parts).moved(self.solution)

    def growth(self) -> Float[np.ndarray, "parts 3"]:
        """Factor by which each side of each part grows."""
        grown = (self.basis.growth * self.solution[None]).sum(axis=2)
        found: np.ndarray = 1.0 + grown / (2.0 * self.basis.half)
        return found


@dataclass(frozen=True, eq=False)
class _Columns:
    """Columns of some of the points, sorted by part, and what else of them a fit needs.

    Attributes:
        order: (N,) rows of the points; points, normals: (N, 3); bounds: (C + 1,) first point of each part.
        spline: (3, K, N), own: (3, 4, N) columns.
        across: (N, 3) weight of a match along each axis; facing: (N,) axis that the surface faces.
    """

    order: np.ndarray
    points: np.ndarray
    normals: np.ndarray
    bounds: np.ndarray
    spline: np.ndarray
    own: np.ndarray
    across: np.ndarray
    facing: np.ndarray


@dataclass(frozen=True, eq=False)
class StructureModel:
    """One model made ready for structure-keeping fits: what depends on it alone.

    Attributes:
        basis: its columns; points: (N, 3), parts: (N,), normals: (N, 3) pointing outward, of its surface, unit box.
    """

    basis: StructureBasis
    points: Float[np.ndarray, "points 3"]
    parts: Int[np.ndarray, " points"]
    normals: Float[np.ndarray, "points 3"]
    _freedom: tuple[np.ndarray, ...]
    _columns: dict[int, _Columns] = field(default_factory=dict)

    @classmethod
    def of(
        cls,
        structure: Structure,
        points: Float[np.ndarray, "points 3"],
        parts: Int[np.ndarray, " points"],
        normals: Float[np.ndarray, "points 3"],
        config: StructureConfig,
    ) -> StructureModel:
        """Set up a model of this structure; all in its unit box."""
        basis = structure_basis(structure, config)
        freedom = (
            growth_limits(basis),
            part_boxes(basis),
            spline_spans(basis),
            spline_slopes(basis),
            possible_leans(basis),
            possible_bends(basis, points, parts),
        )
        return cls(basis, points, parts, normals, freedom)

    def moved(self, found: StructureMap) -> Float[np.ndarray, "points 3"]:
        """Move the model's own points; float32."""
        columns, basis = self.columns(1), self.basis
        result = np.empty_like(columns.points)
        apply_columns(
            columns.spline, columns.own, columns.bounds, basis.group, self._freedom[1], basis.lean_axis, columns.points,
            found.solution, basis.growth, self._freedom[0], result,
        )  # fmt: skip
        ordered = np.empty_like(result)
        ordered[columns.order] = result
        return ordered

    def step(self, count: int) -> int:
        """Compute the step at which about `count` of the points are taken."""
        return max(1, len(self.points) // count)

    def thinned(self, count: int) -> _Columns:
        """Columns of about `count` of the points."""
        return self.columns(self.step(count))

    def columns(self, step: int) -> _Columns:
        """Columns of every `step`-th point in the order of the parts; computed once."""
        if step not in self._columns:
            order = np.argsort(self.parts, kind="stable")[::step]
            parts = self.parts[order]
            place = np.ascontiguousarray(self.points[order], dtype=np.float32)
            bounds = np.searchsorted(parts, np.arange(self.basis.structure.parts + 1))
            normals = np.ascontiguousarray(self.normals[order], dtype=np.float32)
            squared = self.normals[order] ** 2
            across, facing = (ALONG + (1.0 - ALONG) * squared).astype(np.float32), squared.argmax(axis=1)
            columns = self.basis.columns(place, parts)
            self._columns[step] = _Columns(order, place, normals, bounds, *columns, across, facing)
        return self._columns[step]

    @cached_property
    def spacing(self) -> float:
        """Mean squared distance between two samples of the model's surface, unit box."""
        return spacing(np.asarray(self.points, dtype=np.float32))

    @cached_property
    def squared_diagonal(self) -> float:
        """Squared diagonal of the box of the model's points, unit box."""
        return float(squared_diagonal(self.points))

    @cached_property
    def heights(self) -> Float[np.ndarray, " points"]:
        """Height of each point above the lowest of its part, unit box."""
        found: np.ndarray = self.points[:, 1] - (self.basis.middle - self.basis.half)[self.parts, 1]
        return found

    @cached_property
    def feet(self) -> Float[np.ndarray, " points"]:
        """Weight of each point that stands on the floor, 1 in all; 0 for the others."""
        low = (self.basis.middle - self.basis.half)[self.parts, 1]
        found = (self.basis.standing[self.parts] & (self.points[:, 1] < low + STANDS)).astype(np.float64)
        return found / max(found.sum(), 1.0)


@dataclass(frozen=True, eq=False)
class Evidence:
    """What a scan shows of one model's surface, in the scan's unit box.

    Attributes:
        goal: (M, 3) points of the scan, in random order.
        visible: how surely places (Q, 3) would have been seen, (Q,) from 0 to 1.
        floor: height of the floor that the object stands on; None where it is not known.
        spacing: mean squared distance between two samples of the scan's surface; 0 for an exact one.
    """

    goal: Float[np.ndarray, "goal 3"]
    visible: Callable[[np.ndarray], np.ndarray]
    floor: float | None = None
    spacing: float = 0.0

    def some(self, count: int) -> Float[np.ndarray, "some 3"]:
        """Take about `count` of the scan's points, evenly; float32."""
        return np.ascontiguousarray(self.goal[:: max(1, len(self.goal) // count)], dtype=np.float32)


def fit_structure(
    model: StructureModel,
    start: Float[np.ndarray, "points 3"],
    evidence: Evidence,
    config: StructureConfig,
    matched: Float[np.ndarray, "points 3"] | None = None,
) -> StructureMap:
    """Fit the unknowns of one model to a scan.

    Args:
        start: (N, 3) where unseen points of the model are held.
        matched: (N, 3) where its points are when they are first matched; at `start` if it is None.
    """
    return fit_some(model, start, evidence, config, matched)[0]


def fit_some(
    model: StructureModel,
    start: Float[np.ndarray, "points 3"],
    evidence: Evidence,
    config: StructureConfig,
    matched: Float[np.ndarray, "points 3"] | None = None,
) -> tuple[StructureMap, Float[np.ndarray, "some 3"]]:
    """Fit as `fit_structure`, and return too where the points that were used came to lie, in the order of the parts."""
    basis = model.basis
    columns = model.thinned(config.points)
    place = np.ascontiguousarray(start[columns.order], dtype=np.float32)
    seen = evidence.visible(place + OUTSIDE * columns.normals)
    stiff = basis.stiff.copy()
    hold_thickness(
        columns.normals, columns.bounds, seen, basis.half, THIN, BLUR * np.sqrt(evidence.spacing), basis.growth,
        config.thickness, stiff,
    )  # fmt: skip
    solution = np.zeros((3, basis.unknowns))
    moved = place.copy() if matched is None else np.ascontiguousarray(matched[columns.order], dtype=np.float32)
    weight = 0.0 if evidence.floor is None else config.floor
    # A point above a sole stays as far above the floor.
    floor = (0.0 if evidence.floor is None else evidence.floor) + model.heights[columns.order]
    limits, boxes, spans, slopes, leans, bends = model._freedom
    fit_rounds(
        columns.spline,
        columns.own,
        columns.bounds,
        basis.group,
        boxes,
        basis.lean_axis,
        columns.points,
        columns.across,
        columns.facing,
        place,
        seen.astype(np.float32),
        (config.unseen * (1.0 - seen) / len(seen)).astype(np.float32),
        evidence.some(config.points),
        stiff,
        basis.growth,
        limits,
        spans,
        slopes,
        leans,
        bends,
        basis.ends.axis,
        basis.ends.inside,
        basis.ends.column,
        basis.ends.factor,
        config.flush,
        weight * model.feet[columns.order] * model.step(config.points),
        floor,
        config.iterations,
        config.robust**2,
        MIN_SCALE,
        config.lean_gain,
        solution,
        moved,
    )
    return StructureMap(basis, solution), moved
