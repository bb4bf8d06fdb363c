"""Refitting a structure map to a scan while some of it is held: rounds of nearest neighbours and least squares."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from kpred.ops.nearest_cpu import nearest_of_one
from kpred.ops.typing import Bool, Float, Int
from kpred.refinement.part_points import PartPoints
from kpred.refinement.structure_basis import StructureBasis
from kpred.studio.limits import Limits
from kpred.studio.shape import SEEN_DISTANCE

ROUNDS = 10
POINTS = 1024
"""Points of the model and of the scan that are matched in each round."""

KEEP_UNSEEN = 0.3
"""Weight by which surface that the scan does not show stays where it is; that of all matches is 2."""

KEEP_THICKNESS = 1.0
"""Weight of the growth of thin parts."""

ROBUST, MIN_SCALE = 25.0, 1e-4
"""Matches farther than this times the median squared distance count less and less; least such distance."""


class Demand(NamedTuple):
    """Rows (D, U) of unknowns along one axis, the changes (D,) that they should bring, and their common weight."""

    rows: np.ndarray
    changes: np.ndarray
    weight: float


Demands = Callable[[np.ndarray, int], Demand]
"""From a solution and an axis to what is demanded of its change."""


def refit_solution(
    basis: StructureBasis,
    samples: PartPoints,
    solution: Float[np.ndarray, "3 unknowns"],
    goal: Float[np.ndarray, "goal 3"],
    demanded: Demands,
    free: Int[np.ndarray, " free"],
    thin: Bool[np.ndarray, "parts 3"],
    limits: Limits,
) -> Float[np.ndarray, "3 unknowns"]:
    """Fit the free unknowns of a map to a scan, the scan's unit box.

    Args:
        samples: of the model's surface; demanded: what is held; thin: sides of parts that keep their length.
    """
    some = np.arange(0, len(samples.points), max(1, len(samples.points) // POINTS))
    few = PartPoints(basis, samples.points[some], samples.parts[some])
    rows = [few.rows(axis)[:, free] for axis in range(3)]
    target = np.ascontiguousarray(goal[:: max(1, len(goal) // POINTS)], dtype=np.float32)
    found, start = solution.copy(), few.moved(solution)
    seen = near(start, target)
    keep = KEEP_UNSEEN * ~seen / len(seen)
    for _ in range(ROUNDS):
        moved = few.moved(found)
        pull, weight = match(moved, target, seen)
        change = np.zeros_like(found)
        for axis in range(3):
            grow = basis.growth[thin[:, axis], axis][:, free]
            held, wanted, exact = demanded(found, axis)
            held = held[:, free]
            stiff = basis.stiff[axis][np.ix_(free, free)]
            normal = rows[axis].T @ ((weight + keep)[:, None] * rows[axis]) + stiff
            normal += KEEP_THICKNESS * grow.T @ grow + exact * held.T @ held
            right = rows[axis].T @ (pull[:, axis] + keep * (start - moved)[:, axis]) + exact * held.T @ wanted
            right -= (basis.stiff[axis] @ found[axis])[free]
            right -= KEEP_THICKNESS * grow.T @ (basis.growth[thin[:, axis], axis] @ (found[axis] - solution[axis]))
            change[axis, free] = np.linalg.solve(normal, right)
        for axis in range(3):
            found[axis] += limits.fraction(found[axis], change[axis], axis) * change[axis]
    return found


def near(points: Float[np.ndarray, "points 3"], goal: Float[np.ndarray, "goal 3"]) -> Bool[np.ndarray, " points"]:
    """Mark the points that have a point of the scan near them."""
    squared, _ = nearest_of_one(np.ascontiguousarray(points, dtype=np.float32), goal)
    found: np.ndarray = squared < SEEN_DISTANCE**2
    return found


def match(
    moved: Float[np.ndarray, "points 3"], goal: Float[np.ndarray, "goal 3"], seen: Bool[np.ndarray, " points"]
) -> tuple[Float[np.ndarray, "points 3"], Float[np.ndarray, " points"]]:
    """Match a model's points and a scan's both ways: weighted sums of offsets, and weights, of the model's points."""
    place = np.ascontiguousarray(moved, dtype=np.float32)
    pull, weight = np.zeros((len(moved), 3)), np.zeros(len(moved))
    squared, index = nearest_of_one(goal, place)
    ratio = _robust(squared) / len(goal)
    np.add.at(pull, index, ratio[:, None] * (goal - moved[index]))
    np.add.at(weight, index, ratio)
    squared, index = nearest_of_one(place, goal)
    ratio = seen * _robust(squared) / len(moved)
    pull += ratio[:, None] * (goal[index] - moved)
    return pull, weight + ratio


def _robust(squared: np.ndarray) -> np.ndarray:
    scale = ROBUST * max(float(np.median(squared)), MIN_SCALE)
    found: np.ndarray = (scale / (scale + squared)) ** 2
    return found
