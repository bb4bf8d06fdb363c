"""Where an undeformed model stands in the scan: yaw, size, place; in one size or in one size per axis."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from kpred.ops.typing import Float
from kpred.refinement.placement_cpu import place_rounds

ROBUST, MIN_SCALE = 1600.0, 1e-4
"""Points farther than 20 times the median distance count less and less; least squared distance that counts as one."""


@dataclass(frozen=True, eq=False)
class Placement:
    """x' = R_yaw (size * x) + shift, from a model's unit box to the scan's.

    Attributes:
        yaw: about +y, from +z towards +x, radians; size: (3,) along the model's axes; shift: (3,).
    """

    yaw: float
    size: Float[np.ndarray, "3"]
    shift: Float[np.ndarray, "3"]

    @classmethod
    def identity(cls) -> Placement:
        """Place the model as it is in its unit box."""
        return cls(0.0, np.ones(3), np.zeros(3))

    def matrix(self) -> Float[np.ndarray, "4 4"]:
        """Build the homogeneous matrix of the same map."""
        c, s = np.cos(self.yaw), np.sin(self.yaw)
        found = np.eye(4)
        found[:3, :3] = np.array([[c, 0.0, s], [0.0, 1.0, 0.0], [-s, 0.0, c]]) * self.size
        found[:3, 3] = self.shift
        return found

    def __call__(self, points: Float[np.ndarray, "points 3"]) -> Float[np.ndarray, "points 3"]:
        """Move points of the model."""
        matrix = self.matrix()
        found: np.ndarray = points @ matrix[:3, :3].T + matrix[:3, 3]
        return found


def fit_placement(
    points: Float[np.ndarray, "points 3"],
    start: Placement,
    goal: Float[np.ndarray, "goal 3"],
    visible: Float[np.ndarray, " points"],
    *,
    per_axis: bool,
    free_yaw: bool,
    free_size: bool = True,
    expected: Float[np.ndarray, "points 3"] | None = None,
    rounds: int = 8,
) -> Placement:
    """Place an undeformed model so that its seen surface and the scan lie closest, both ways; unit boxes.

    Args:
        points: of the model, float32; start: where the search begins; goal: points of the scan, float32.
        visible: how surely each point of the model was seen.
        expected: where the model's points are expected, by which unseen ones are held; None: where `start` puts them.
        per_axis: whether each axis has a size of its own; free_yaw, free_size: whether yaw and size are unknown.
    """
    numbers = np.concatenate([[start.yaw], start.size, start.shift])
    first = np.ascontiguousarray(start(points) if expected is None else expected, dtype=np.float32)
    moved = np.empty_like(first)
    held = ((1.0 - visible) / len(points)).astype(np.float32)
    place_rounds(
        points, first, visible.astype(np.float32), held, goal, per_axis, free_yaw, free_size, rounds, ROBUST, MIN_SCALE,
        numbers, moved,
    )  # fmt: skip
    return Placement(float(numbers[0]), numbers[1:4].copy(), numbers[4:].copy())
