"""Deform one model to a scan so that what makes it CAD stays: the structure-keeping fit."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from kpred.ops.typing import Float, Int
from kpred.refinement.structure_basis import StructureBasis
from kpred.refinement.structure_config import StructureConfig
from kpred.refinement.structure_cpu import apply_columns, fit_rounds

MIN_GROWTH, MAX_GROWTH = 0.25, 4.0
"""Least and largest factor by which a part's side may shrink or grow."""

MIN_SCALE = 1e-5
"""Least squared distance that counts as one in robust weights, unit box."""


@dataclass(frozen=True, eq=False)
class StructureMap:
    """A deformation that keeps structure, of one model; from its unit box to the scan's.

    Attributes:
        basis: of the model; solution: (3, U) unknowns.
    """

    basis: StructureBasis
    solution: np.ndarray

    def __call__(
        self, points: Float[np.ndarray, "points 3"], parts: Int[np.ndarray, " points"]
    ) -> Float[np.ndarray, "points 3"]:
        """Move points of the given parts."""
        order = np.argsort(parts, kind="stable")
        place = np.ascontiguousarray(points[order], dtype=np.float64)
        bounds = np.searchsorted(parts[order], np.arange(self.basis.structure.parts + 1))
        moved = np.empty_like(place)
        basis = self.basis
        columns = basis.columns(place, parts[order])
        boxes = (basis.group, part_boxes(basis), basis.lean_axis)
        apply_columns(*columns, bounds, *boxes, place, self.solution, basis.growth, growth_limits(basis), moved)
        found = np.empty_like(moved)
        found[order] = moved
        return found


def part_boxes(basis: StructureBasis) -> Float[np.ndarray, "parts 13"]:
    """Own axes (longest first), middle, and 1 for parts that do not lie along the axes."""
    structure = basis.structure
    found = np.zeros((structure.parts, 13))
    for part in range(structure.parts):
        axes = structure.axes[part]
        side = np.diff(structure.boxes[part], axis=0)[0]
        order = np.argsort(-side, kind="stable")
        found[part, :9] = axes[order].reshape(-1)
        found[part, 9:12] = structure.boxes[part].mean(axis=0) @ axes
        found[part, 12] = float((axes != np.eye(3)).any())
    return found


def possible_leans(basis: StructureBasis) -> Int[np.ndarray, "groups 3"]:
    """Leans of each group in x, y and z: 0 impossible, 1 where the scan shows it, 2 free since the part is oblique."""
    structure = basis.structure
    found = np.ones((int(basis.group.max()) + 1, 3), np.int64)
    for part in range(structure.parts):
        group = basis.group[part]
        if (structure.axes[part] != np.eye(3)).any():
            found[group] = 2
        # A part that is its own mirror image leans neither to a side nor along one.
        if np.isfinite(structure.mirror) and structure.mirrored_parts[part] == part:
            found[group, 0] = 0
            found[group, 1] = 0 if basis.lean_axis[part, 1] == 0 else found[group, 1]
        # What is wider than it is long along the axis leans as a whole model would: not by itself.
        for axis in range(3):
            along = basis.lean_axis[part, axis]
            if basis.half[part, along] < 1.5 * basis.half[part, axis]:
                found[group, axis] = 0
    return found


def possible_bends(basis: StructureBasis) -> Int[np.ndarray, "groups 3"]:
    """Bends of each group in x, y and z: 1 for parts that are curved, unless symmetry forbids it."""
    structure = basis.structure
    found = np.zeros((int(basis.group.max()) + 1, 3), np.int64)
    for part in np.flatnonzero(structure.curved):
        found[basis.group[part]] = 1
        if np.isfinite(structure.mirror) and structure.mirrored_parts[part] == part:
            found[basis.group[part], 0] = 0
    return found


def growth_limits(basis: StructureBasis) -> Float[np.ndarray, "parts 3 3"]:
    """Lowest and highest growth of each part's sides, and their half side; unit box."""
    half = basis.half
    return np.stack([2 * half * (MIN_GROWTH - 1), 2 * half * (MAX_GROWTH - 1), half], axis=2)


def fit_structure(
    basis: StructureBasis,
    points: Float[np.ndarray, "points 3"],
    parts: Int[np.ndarray, " points"],
    start: Float[np.ndarray, "points 3"],
    goal: Float[np.ndarray, "goal 3"],
    visible: Float[np.ndarray, " points"],
    held: Float[np.ndarray, " points"],
    config: StructureConfig,
) -> StructureMap:
    """Fit the unknowns of one model to a scan.

    Args:
        points: of the source; parts: theirs; start: where the keypoints put them; unit boxes.
        goal: points of the scan; visible: how surely each point of the source was seen; held: weight of staying at
            `start`.
    """
    order = np.argsort(parts, kind="stable")[:: max(1, len(points) // config.points)]
    some = parts[order]
    place = np.ascontiguousarray(points[order], dtype=np.float32)
    bounds = np.searchsorted(some, np.arange(basis.structure.parts + 1))
    solution = np.zeros((3, basis.unknowns))
    moved = np.empty_like(place)
    few = np.ascontiguousarray(goal[:: max(1, len(goal) // config.points)], dtype=np.float32)
    fit_rounds(
        *basis.columns(place, some),
        bounds,
        basis.group,
        part_boxes(basis),
        basis.lean_axis,
        place,
        np.ascontiguousarray(start[order], dtype=np.float32),
        visible[order].astype(np.float32),
        held[order].astype(np.float32),
        few,
        basis.stiff,
        basis.growth,
        growth_limits(basis),
        possible_leans(basis),
        possible_bends(basis),
        config.iterations,
        config.robust**2,
        MIN_SCALE,
        config.lean_gain,
        solution,
        moved,
    )
    return StructureMap(basis, solution)
