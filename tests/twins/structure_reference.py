"""The rounds of the structure-keeping fit in plain numpy: dense rows, brute-force neighbours, `np.linalg.solve`.

Slow; `kpred.refinement.structure_cpu` is held equal to it by tests.
"""

from __future__ import annotations

from dataclasses import dataclass
from inspect import signature
from types import SimpleNamespace
from typing import Any

import numpy as np

from kpred.ops.typing import Bool, Float, Int
from kpred.refinement.matching_cpu import MIN_SEEN, SEEN, SHARP
from kpred.refinement.structure_basis import KINDS, RIGID
from kpred.refinement.structure_cpu import FLATTEST, LINEAR, RELAXATION, SNAP, SNAPPED, STIFFER, fit_rounds

MOVE, GROW, LEAN, BEND = range(KINDS)

MIN_LEAN = 1e-4
"""A part that leans by less, as a fraction of its half side, is not rotated."""


@dataclass(frozen=True, eq=False)
class Family:
    """The maps of one model at N points of it, sorted by part; see `kpred.refinement.structure_cpu.fit_rounds`."""

    spline: Float[np.ndarray, "3 controls points"]
    own: Float[np.ndarray, "3 kinds points"]
    bounds: Int[np.ndarray, " ends"]
    group: Int[np.ndarray, " parts"]
    boxes: Float[np.ndarray, "parts 13"]
    lean_axis: Int[np.ndarray, "parts 3"]
    points: Float[np.ndarray, "points 3"]
    growth: Float[np.ndarray, "parts 3 unknowns"]
    limits: Float[np.ndarray, "parts 3 3"]

    @property
    def controls(self) -> int:
        """Controls of the spline."""
        return self.spline.shape[1]

    @property
    def parts(self) -> Int[np.ndarray, " points"]:
        """Part of each point."""
        return np.repeat(np.arange(len(self.group)), np.diff(self.bounds))

    def column(self, part: int, kind: int) -> int:
        """Return the number of an unknown of a part."""
        return int(self.controls + KINDS * self.group[part] + kind)

    def rows(self, axis: int) -> Float[np.ndarray, "points unknowns"]:
        """Compute the dense rows of all points along one axis, float64."""
        parts = self.parts
        found = np.zeros((len(parts), self.growth.shape[2]))
        found[:, : self.controls] = self.spline[axis].T
        for kind in range(KINDS):
            found[np.arange(len(parts)), self.controls + KINDS * self.group[parts] + kind] = self.own[axis, kind]
        return found

    def apply(self, solution: Float[np.ndarray, "3 unknowns"]) -> Float[np.ndarray, "points 3"]:
        """Compute where a solution takes the points."""
        straight = solution.copy()
        straight[:, self.controls + LEAN :: KINDS] = straight[:, self.controls + BEND :: KINDS] = 0.0
        moved = self.points + np.stack([self.rows(axis) @ straight[axis] for axis in range(3)], axis=1)
        for part in range(len(self.group)):
            mine = slice(self.bounds[part], self.bounds[part + 1])
            if self.bounds[part] == self.bounds[part + 1]:
                continue
            lean = self._lean(part, solution)
            if self.boxes[part, 12] > 0 or np.abs(lean).max() > MIN_LEAN:
                moved[mine] = self._rotated(part, solution, lean, moved[mine])
            moved[mine] += (self.own[:, BEND, mine] * solution[:, self.column(part, BEND)][:, None]).T
        return moved

    def _lean(self, part: int, solution: np.ndarray) -> np.ndarray:
        """Compute the slope (3,) of each coordinate along its lean axis; mirrored parts lean against each other."""
        mine, across = slice(self.bounds[part], self.bounds[part + 1]), self.lean_axis[part]
        local = self.points[mine][:, across] - self.boxes[part, 9:12][across]
        sign = np.sign((self.own[:, LEAN, mine].T * local).sum(axis=0))
        found: np.ndarray = sign * solution[:, self.column(part, LEAN)] / self.limits[part, across, 2]
        return found

    def _rotated(self, part: int, solution: np.ndarray, lean: np.ndarray, moved: np.ndarray) -> np.ndarray:
        """Rotate the points of a part and scale them along its own axes."""
        mine, middle = slice(self.bounds[part], self.bounds[part + 1]), self.boxes[part, 9:12]
        axes, grown = self.boxes[part, :9].reshape(3, 3), (self.growth[part] * solution).sum(axis=1)
        factor = 1.0 + grown / (2.0 * self.limits[part, :, 2])
        matrix = np.diag(factor)
        for axis in range(3):
            matrix[axis, self.lean_axis[part, axis]] += lean[axis]
        # Images of the own axes, each made perpendicular to the longer ones and not normalised.
        directions, lengths = np.linalg.qr(matrix @ axes.T)
        images = directions * np.diag(lengths)
        source = self.points[mine] - middle
        # Such a part is mapped affinely: from any point it follows where its middle goes.
        place = moved[0] - factor * source[0]
        rotated: np.ndarray = place + source @ axes.T @ images.T
        return rotated


def fit_rounds_reference(*arguments: Any) -> None:
    """Fill `solution` and `moved` as `kpred.refinement.structure_cpu.fit_rounds` does, from the same arguments."""
    a = SimpleNamespace(**signature(fit_rounds.py_func).bind(*arguments).arguments)
    family = Family(a.spline, a.own, a.bounds, a.group, a.boxes, a.lean_axis, a.points, a.growth, a.limits)
    rows, leaning = [family.rows(axis) for axis in range(3)], a.can_lean == 2
    steps, last = _end_rows(a.end_axis, a.end_column, a.end_factor, a.stiff.shape[1]), a.rounds * 2 // 3
    is_flush = a.end_inside == 0.0
    tied = np.where(is_flush, a.flush, 0.0)
    for number in range(a.rounds):
        sides = a.facing if number >= last else None
        wanted, weight = match_reference(a.moved, a.goal, a.visible, number % 2, a.robust, a.minimum, sides)
        outside = a.end_inside + (steps * a.solution[a.end_axis]).sum(axis=1)
        if number == last:
            tied = np.where(is_flush & (np.abs(outside) < SNAP), SNAPPED, 0.0)
        if number >= last:
            tied[~is_flush & (outside * a.end_factor[:, 1] > 0)] = SNAPPED
        wanted, weight = wanted + a.held[:, None] * a.start, weight + a.held
        if number == a.rounds // 2:
            leaning |= (a.can_lean == 1) & _leans_explain(family, wanted, weight, a.moved, a.lean_gain, len(a.can_lean))
        ahead = RELAXATION if 0 < number < a.rounds - 2 else 1.0
        for axis in range(3):
            extra = a.feet if axis == 1 else 0.0 * a.feet
            pull = a.across[:, axis] * (wanted[:, axis] - weight * a.points[:, axis])
            pull += extra * (a.floor - a.points[:, 1])
            normal = rows[axis].T @ ((a.across[:, axis] * weight + extra)[:, None] * rows[axis]) + a.stiff[axis]
            mine = steps * (a.end_axis == axis)[:, None]
            normal += mine.T @ (tied[:, None] * mine)
            right = rows[axis].T @ pull - mine.T @ (tied * a.end_inside)
            forbidden = np.zeros(len(normal))
            forbidden[family.controls + LEAN :: KINDS] = RIGID * ~leaning[:, axis]
            forbidden[family.controls + BEND :: KINDS] = RIGID * (a.can_bend[:, axis] == 0)
            found = _monotone(normal + np.diag(forbidden), right, family.controls, a.spans, a.slopes, axis)
            a.solution[axis] += ahead * (found - a.solution[axis])
        _clip_growth(family, a.solution, a.spans, a.slopes)
        a.moved[:] = family.apply(a.solution)


def _end_rows(axis: np.ndarray, column: np.ndarray, factor: np.ndarray, unknowns: int) -> np.ndarray:
    """Build the dense rows (F, U) of the steps between ends."""
    found = np.zeros((len(axis), unknowns))
    np.add.at(found, (np.arange(len(axis))[:, None], column), factor)
    return found


def match_reference(
    moved: Float[np.ndarray, "points 3"],
    goal: Float[np.ndarray, "goal 3"],
    visible: Float[np.ndarray, " points"],
    first: int,
    robust: float,
    minimum: float,
    facing: Int[np.ndarray, " points"] | None = None,
) -> tuple[Float[np.ndarray, "points 3"], Float[np.ndarray, " points"]]:
    """Match every second point of each cloud to the nearest of the other: weighted sums of places, and weights.

    With `facing`, distances count more along the axis that the surface faces.
    """
    stretch = np.ones((len(moved), 3)) if facing is None else np.where(np.eye(3)[facing] > 0, SHARP, 1.0)
    stretch = stretch.astype(np.float32)
    wanted, weight = np.zeros((len(moved), 3)), np.zeros(len(moved))
    seen = np.flatnonzero(visible >= SEEN)
    seen = seen if len(seen) >= MIN_SEEN else np.arange(len(moved))
    queries = goal[first::2]
    squared = ((stretch[seen][None] * (queries[:, None] - moved[seen][None])) ** 2).sum(axis=2)
    rows, ratio = seen[squared.argmin(axis=1)], _robust(squared.min(axis=1), robust, minimum) / len(queries)
    np.add.at(wanted, rows, ratio[:, None] * queries)
    np.add.at(weight, rows, ratio)
    some = np.arange(first, len(moved), 2)
    squared = ((stretch[some][:, None] * (moved[some][:, None] - goal[None])) ** 2).sum(axis=2)
    ratio = visible[some] * _robust(squared.min(axis=1), robust, minimum) / len(some)
    wanted[some] += ratio[:, None] * goal[squared.argmin(axis=1)]
    weight[some] += ratio
    return wanted, weight


def _robust(squared: np.ndarray, robust: float, minimum: float) -> np.ndarray:
    """Weigh matches by their squared distances; the median decides what is far."""
    if robust <= 0:
        return np.ones(len(squared))
    scale = np.sort(squared)[(len(squared) - 1) // 2] * robust + minimum
    found: np.ndarray = (scale / (scale + squared)) ** 2
    return found


def _leans_explain(
    family: Family, wanted: np.ndarray, weight: np.ndarray, moved: np.ndarray, lean_gain: float, groups: int
) -> Bool[np.ndarray, "groups 3"]:
    """Check whether a lean of each group along each axis explains enough of what is still off."""
    group, lean = family.group[family.parts], family.own[:, LEAN].T
    residual = wanted - weight[:, None] * moved
    pull, hold, off = np.zeros((3, groups, 3))
    np.add.at(pull, group, lean * residual)
    np.add.at(hold, group, lean**2 * weight[:, None])
    np.add.at(off, group, residual**2 / np.maximum(weight, 1e-9)[:, None])
    gain = pull**2 / np.maximum(hold, 1e-12)
    found: np.ndarray = (gain > lean_gain) & (gain > LINEAR * off)
    return found


def _monotone(
    normal: np.ndarray, right: np.ndarray, controls: int, spans: np.ndarray, slopes: np.ndarray, axis: int
) -> np.ndarray:
    """Solve for one axis, with the least of the listed stiffnesses at which the spline folds nowhere."""
    second = np.zeros_like(normal)
    difference = np.diff(np.eye(controls), 2, axis=0)
    second[:controls, :controls] = difference.T @ difference
    found: np.ndarray = np.linalg.solve(normal, right)
    for stiffness in STIFFER:
        steps = [np.diff(found[first : last + 1]) for first, last in spans[:, axis] if first >= 0]
        together = np.concatenate([np.zeros(0), *steps])
        if not ((together < slopes[axis, 0]) | (together > slopes[axis, 1])).any():
            break
        found = np.linalg.solve(normal + stiffness * second, right)
    return found


def _clip_growth(family: Family, solution: np.ndarray, spans: np.ndarray, slopes: np.ndarray) -> None:
    """Clip the growth of each part in `solution`: of its box, then of its flattest place."""
    for part in range(len(family.group)):
        grow = family.column(part, GROW)
        for axis in range(3):
            low, high, half = family.limits[part, axis]
            grown = float(family.growth[part, axis] @ solution[axis])
            solution[axis, grow] += (np.clip(grown, low, high) - grown) / 2
            first, last = spans[part, axis]
            if first >= 0:
                least = np.diff(solution[axis, first : last + 1]).min() if last > first else np.inf
                slope = least / slopes[axis, 2] + solution[axis, grow] / half
                solution[axis, grow] += max(FLATTEST - 1.0 - slope, 0.0) * half
