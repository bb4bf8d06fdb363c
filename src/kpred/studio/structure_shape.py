"""A shape whose parts move and grow while what is flat, square and mirrored stays so; corrected by least squares.

A correction changes the unknowns of the structure map by the smallest step, in the map's own sense of stiffness, that
meets what is demanded of it. Leans and bends of parts stay as they are.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from kpred.errors import ConfigError
from kpred.ops.typing import Float, Int
from kpred.refinement.part_points import PartPoints
from kpred.refinement.structure_basis import KINDS, StructureBasis
from kpred.studio.gestures import WHOLE
from kpred.studio.limits import Limits
from kpred.studio.refit import Demand, refit_solution
from kpred.studio.shape import Held, Shape

EXACT = 100.0
"""Weight of places and sizes that a person has set, beside which contacts between parts count 1."""

KEEP_KEYPOINT, KEEP_END = 0.05, 0.01
"""Weight of keypoints, and of ends of parts, that stay where they are while another keypoint is dragged."""

KEEP_LENGTH, KEEP_THICKNESS = 1e-3, 10.0
"""Weight of the relative growth of parts while a size is set, and of the growth of thin ones at all times."""

KEEP_PLACE = 10.0
"""Weight of the feet, and of the object's middle, while a size is set."""

THIN = 0.15
"""A part with a side shorter than this is a board or a bar, and keeps its thickness; unit box."""

STIFFER = (0.0, 0.01, 0.1, 1.0, 10.0)
"""Stiffnesses of the map that all parts share, of which the least is taken at which no part folds."""

REACHED = 0.02
"""Fraction of its length by which a size may be missed: parts that touch may stop each other."""


@dataclass(frozen=True, eq=False)
class StructureModel:
    """What corrections of one model share.

    Attributes:
        basis: of its structure map; vertices, keypoints, samples: points of the model, its unit box.
    """

    basis: StructureBasis
    vertices: PartPoints
    keypoints: PartPoints
    samples: PartPoints

    @cached_property
    def limits(self) -> Limits:
        """Limits of the unknowns."""
        return Limits.of(self.basis)

    @cached_property
    def free(self) -> Int[np.ndarray, " free"]:
        """Unknowns that corrections change: all but leans and bends."""
        own = np.arange(self.basis.unknowns) - self.basis.controls
        found: np.ndarray = np.flatnonzero((own < 0) | (own % KINDS < 2))
        return found

    @cached_property
    def ends(self) -> PartPoints:
        """Lowest and highest corner of each part's box."""
        parts = np.arange(len(self.basis.half))
        corners = np.concatenate([self.basis.middle - self.basis.half, self.basis.middle + self.basis.half])
        return PartPoints(self.basis, corners, np.concatenate([parts, parts]))


@dataclass(frozen=True, eq=False)
class _Demands:
    """Linear demands on a change of the unknowns along one axis: rows (D, U), changes (D,), weights (D,)."""

    rows: np.ndarray
    changes: np.ndarray
    weights: np.ndarray

    @classmethod
    def together(cls, *parts: Demand) -> _Demands:
        weights = [np.full(len(one.changes), one.weight) for one in parts]
        return cls(
            np.concatenate([one.rows for one in parts]),
            np.concatenate([one.changes for one in parts]),
            np.concatenate(weights),
        )


class _Responses:
    """Changes of the unknowns along one axis that demands bring; a stiffer map wherever parts would fold."""

    def __init__(self, model: StructureModel, axis: int, demands: _Demands) -> None:
        self.model, self.axis, self.demands = model, axis, demands
        self._found: dict[float, np.ndarray] = {}

    def change(self, solution: Float[np.ndarray, " unknowns"], changes: np.ndarray) -> Float[np.ndarray, " unknowns"]:
        """Compute the change for demanded changes (D,), as far as the limits allow."""
        best, reached = np.zeros_like(solution), -1.0
        for stiffness in STIFFER:
            change = self._response(stiffness) @ changes
            fraction = self.model.limits.fraction(solution, change, self.axis)
            if fraction > reached:
                best, reached = fraction * change, fraction
            if fraction >= 1.0:
                break
        return best

    def _response(self, stiffness: float) -> np.ndarray:
        """(U, D) change of the unknowns for each unit of the demanded changes."""
        if stiffness not in self._found:
            basis, free = self.model.basis, self.model.free
            second = np.zeros((basis.controls - 2, basis.unknowns))
            second[:, : basis.controls] = np.diff(np.eye(basis.controls), 2, axis=0)
            stiff = (basis.stiff[self.axis] + stiffness * second.T @ second)[np.ix_(free, free)]
            rows = self.demands.rows[:, free]
            weighted = rows.T * self.demands.weights
            found = np.zeros((basis.unknowns, len(rows)))
            found[free] = np.linalg.solve(weighted @ rows + stiff, weighted)
            self._found[stiffness] = found
        return self._found[stiffness]


@dataclass(frozen=True, eq=False)
class StructureShape(Shape):
    """A model deformed by a structure map, in the scan's unit box.

    Attributes:
        model: what it is made of; solution: (3, U) unknowns of the map.
    """

    model: StructureModel
    solution: Float[np.ndarray, "3 unknowns"]

    @cached_property
    def vertices(self) -> Float[np.ndarray, "vertices 3"]:
        """Vertices of the mesh."""
        return self.model.vertices.moved(self.solution)

    @cached_property
    def keypoints(self) -> Float[np.ndarray, "keypoints 3"]:
        """Keypoints of the model."""
        return self.model.keypoints.moved(self.solution)

    def pull(self, keypoints: tuple[int, ...], held: Held) -> Callable[[Float[np.ndarray, "moved 3"]], StructureShape]:
        """Make ready to drag some keypoints: their response is computed once, each place costs a product."""
        before = self.keypoints[list(keypoints)]
        demands = [self._dragged(keypoints, held, axis) for axis in range(3)]
        responses = [_Responses(self.model, axis, demands[axis]) for axis in range(3)]

        def at(places: np.ndarray) -> StructureShape:
            solution = self.solution.copy()
            for axis in range(3):
                changes = demands[axis].changes.copy()
                changes[: len(keypoints)] = (places - before)[:, axis]
                solution[axis] += responses[axis].change(self.solution[axis], changes)
            return replace(self, solution=solution)

        return at

    def _dragged(self, keypoints: tuple[int, ...], held: Held, axis: int) -> _Demands:
        """List demands of a drag along one axis; those of the dragged keypoints come first, without change."""
        model, count = self.model, len(self.keypoints)
        pins = [pin for pin in held.pins if pin not in keypoints]
        rest = [one for one in range(count) if one not in keypoints and one not in pins]
        ends = model.ends.rows(axis)
        return _Demands.together(
            Demand(model.keypoints.rows(axis, np.array(keypoints)), np.zeros(len(keypoints)), EXACT),
            self._pinned(held, pins, axis),
            self._sized(held, axis),
            Demand(model.keypoints.rows(axis, np.array(rest, np.int64)), np.zeros(len(rest)), KEEP_KEYPOINT),
            Demand(ends, np.zeros(len(ends)), KEEP_END),
            self._thin(held, axis),
        )

    def _thin(self, held: Held, axis: int) -> Demand:
        sized = {part for part, along in held.sizes if along == axis}
        thin = [part for part in np.flatnonzero(self._sides(axis) < THIN) if int(part) not in sized]
        return Demand(self.model.basis.growth[thin, axis], np.zeros(len(thin)), KEEP_THICKNESS)

    def _sides(self, axis: int) -> np.ndarray:
        """(C,) sides of the parts' boxes along one axis."""
        basis = self.model.basis
        found: np.ndarray = 2.0 * basis.half[:, axis] + basis.growth[:, axis] @ self.solution[axis]
        return found

    def _pinned(self, held: Held, pins: list[int], axis: int) -> Demand:
        changes = np.array([float(held.pins[pin][axis] - self.keypoints[pin, axis]) for pin in pins])
        return Demand(self.model.keypoints.rows(axis, np.array(pins, np.int64)), changes, EXACT)

    def _sized(self, held: Held, axis: int) -> Demand:
        wanted = [(part, length) for (part, along), length in held.sizes.items() if along == axis]
        rows = [self._length_row(part, axis) for part, _ in wanted]
        changes = [length - float(self.sizes(part)[axis]) for part, length in wanted]
        return Demand(np.array(rows).reshape(len(rows), self.model.basis.unknowns), np.array(changes), EXACT)

    def _length_row(self, part: int, axis: int) -> np.ndarray:
        """(U,) growth of a part, or of the whole object, by the unknowns."""
        if part != WHOLE:
            found: np.ndarray = self.model.basis.growth[part, axis]
            return found
        ends = self.model.ends.moved(self.solution)[:, axis]
        rows = self.model.ends.rows(axis, np.array([ends.argmin(), ends.argmax()]))
        whole: np.ndarray = rows[1] - rows[0]
        return whole

    def sizes(self, part: int) -> Float[np.ndarray, "3"]:
        """Measure the sides of a part's box, or of the whole object's, along the axes."""
        if part == WHOLE:
            return np.ptp(self.vertices, axis=0)
        mine = self.vertices[self.model.vertices.parts == part]
        return np.ptp(mine, axis=0) if len(mine) else np.zeros(3)

    def resize(self, part: int, axis: int, length: float, held: Held) -> StructureShape:
        """Give a part, or the whole object, a length along an axis; long parts grow, thin ones keep their thickness.

        Raises:
            ConfigError: its parts cannot become so long or so short.
        """
        demanded = replace(held, sizes={**held.sizes, (part, axis): length})
        found = self
        # Where a part is oblique, its size follows the unknowns only about linearly.
        for _ in range(3):
            found = found._resized(part, axis, demanded)
        reached = float(found.sizes(part)[axis])
        if abs(reached - length) > REACHED * max(length, reached):
            ratio = reached / max(float(self.sizes(part)[axis]), 1e-9)
            raise ConfigError(
                f"The size cannot be reached: parts grow or shrink only so far, here to {ratio:.0%} of the present "
                "size; choose a size nearer to it, or another model."
            )
        return found

    def _resized(self, part: int, axis: int, held: Held) -> StructureShape:
        model, basis = self.model, self.model.basis
        side = self._sides(axis)
        demanded = {one for one, along in held.sizes if along == axis}
        long = [one for one in range(len(side)) if one not in demanded and side[one] >= THIN]
        scaled = basis.growth[long, axis] / np.maximum(side[long], 1e-6)[:, None]
        rest = self._resting(axis)
        demands = _Demands.together(
            self._sized(held, axis),
            Demand(scaled, np.zeros(len(long)), KEEP_LENGTH),
            self._thin(held, axis),
            Demand(rest, np.zeros(len(rest)), KEEP_PLACE),
        )
        solution = self.solution.copy()
        solution[axis] += _Responses(model, axis, demands).change(solution[axis], demands.changes)
        return replace(self, solution=solution)

    def _resting(self, axis: int) -> np.ndarray:
        """(R, U) what stays in place while a size changes: the feet along y, the object's middle along x and z."""
        ends = self.model.ends.moved(self.solution)[:, axis]
        if axis == 1:
            feet = np.flatnonzero(self.model.basis.standing)
            return self.model.ends.rows(axis, feet if len(feet) else np.array([ends.argmin()]))
        rows = self.model.ends.rows(axis, np.array([ends.argmin(), ends.argmax()]))
        middle: np.ndarray = rows.mean(axis=0, keepdims=True)
        return middle

    def refit(self, goal: Float[np.ndarray, "goal 3"], held: Held) -> StructureShape:
        """Fit the unknowns to the points of the scan; pinned keypoints and typed sizes stay."""
        pins = list(held.pins)

        def demanded(solution: np.ndarray, axis: int) -> Demand:
            at = replace(self, solution=solution)
            parts = at._pinned(held, pins, axis), at._sized(held, axis)
            rows, changes = [one.rows for one in parts], [one.changes for one in parts]
            return Demand(np.concatenate(rows), np.concatenate(changes), EXACT)

        model = self.model
        thin = 2.0 * model.basis.half < THIN
        found = refit_solution(
            model.basis, model.samples, self.solution, goal, demanded, model.free, thin, model.limits
        )
        return replace(self, solution=found)
