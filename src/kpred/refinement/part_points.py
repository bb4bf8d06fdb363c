"""Points of a model's parts, made ready once: moved by any solution of the structure map in some milliseconds."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from kpred.ops.typing import Float, Int
from kpred.refinement.freedom import growth_limits, part_boxes
from kpred.refinement.structure_apply_cpu import apply_columns
from kpred.refinement.structure_basis import KINDS, StructureBasis


@dataclass(frozen=True, eq=False)
class PartPoints:
    """Points of known parts of one model, in its unit box.

    Attributes:
        basis: of the model; points: (N, 3); parts: (N,) part of each.
    """

    basis: StructureBasis
    points: Float[np.ndarray, "points 3"]
    parts: Int[np.ndarray, " points"]

    def moved(self, solution: Float[np.ndarray, "3 unknowns"]) -> Float[np.ndarray, "points 3"]:
        """Move the points by a solution of the structure map; the scan's unit box."""
        order, place, bounds, spline, own = self._columns
        basis, found = self.basis, np.empty_like(place)
        boxes, limits = self._boxes
        apply_columns(
            spline, own, bounds, basis.group, boxes, basis.lean_axis, place, solution, basis.growth, limits, found
        )  # fmt: skip
        moved = np.empty_like(found)
        moved[order] = found
        return moved

    def rows(self, axis: int, some: Int[np.ndarray, " some"] | None = None) -> Float[np.ndarray, "some unknowns"]:
        """Compute dense rows (S, U) of some of the points along one axis; of all without `some`."""
        order, _, _, spline, own = self._columns
        inverse = np.empty(len(order), np.int64)
        inverse[order] = np.arange(len(order))
        chosen = inverse if some is None else inverse[some]
        parts = self.parts[order][chosen]
        found = np.zeros((len(chosen), self.basis.unknowns))
        found[:, : self.basis.controls] = spline[axis][:, chosen].T
        index = np.arange(len(chosen))
        for kind in range(KINDS):
            found[index, self.basis.controls + KINDS * self.basis.group[parts] + kind] = own[axis, kind, chosen]
        return found

    @cached_property
    def _boxes(self) -> tuple[np.ndarray, np.ndarray]:
        return part_boxes(self.basis), growth_limits(self.basis)

    @cached_property
    def _columns(self) -> tuple[np.ndarray, ...]:
        order = np.argsort(self.parts, kind="stable")
        place = np.ascontiguousarray(self.points[order], dtype=np.float64)
        parts = self.parts[order]
        bounds = np.searchsorted(parts, np.arange(self.basis.structure.parts + 1))
        return order, place, bounds, *self.basis.columns(place, parts)


def affine_solution(
    basis: StructureBasis, size: Float[np.ndarray, "3"], shift: Float[np.ndarray, "3"]
) -> Float[np.ndarray, "3 unknowns"]:
    """Compute the solution that sizes and shifts a whole model along its axes: x' = size * x + shift."""
    solution = np.zeros((3, basis.unknowns))
    # A quadratic spline whose controls lie on a line, at the middles of their supports, is that line.
    places = (np.arange(basis.controls) - 0.5) / (basis.controls - 2)
    for axis in range(3):
        middle = basis.low[axis] + places * (basis.high[axis] - basis.low[axis])
        solution[axis, : basis.controls] = (size[axis] - 1.0) * middle + shift[axis]
    return solution
