"""Dragging a keypoint: the shape follows every place of the hand; mirror lock and axis lock."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from kpred.errors import ConfigError
from kpred.ops.typing import Float
from kpred.studio.gestures import Axis
from kpred.studio.shape import Place, Shape
from kpred.studio.state import State

AXES = ("x", "y", "z")


@dataclass(frozen=True, eq=False)
class Drag:
    """One keypoint in the hand; `Drag.begin` computes once what all its places share.

    Attributes:
        state: as it was; keypoint: its number; other: that on the other side, or itself, or None without mirror lock.
        axis: the only axis of the object that it moves along, 0 to 2; None: any.
    """

    state: State
    keypoint: int
    other: int | None
    axis: int | None
    _pull: Callable[[np.ndarray], Shape]

    @classmethod
    def begin(cls, state: State, keypoint: int, mirror: bool = False, axis: Axis | None = None) -> Drag:
        """Take a keypoint into the hand.

        Raises:
            ConfigError: there is no such keypoint.
        """
        check_keypoint(state, keypoint)
        pair = state.mirror_pairs[keypoint] if mirror else -1
        other = pair if pair >= 0 else None
        moved = (keypoint,) if other in (None, keypoint) else (keypoint, pair)
        along = None if axis is None else AXES.index(axis)
        return cls(state, keypoint, other, along, state.shape.pull(moved, state.held))

    def shape(self, place: Float[np.ndarray, "3"]) -> Shape:
        """Compute the shape for a place of the hand; the scan's frame and unit."""
        return self._pull(np.stack(list(self._targets(place).values())))

    def dropped(self, place: Float[np.ndarray, "3"]) -> State:
        """Let go at a place: the keypoint, and that on the other side, are pinned where the shape took them."""
        shape = self.shape(place)
        pins: dict[int, Place] = {**self.state.pins}
        for one in self._targets(place):
            pins[one] = shape.keypoints[one].copy()
        return replace(self.state.with_shape(shape), pins=pins)

    def _targets(self, place: np.ndarray) -> dict[int, Place]:
        """Places of the moved keypoints, the scan's unit box."""
        before = self.state.shape.keypoints
        offset = self.state.fit.frame.to_unit(np.asarray(place, dtype=np.float64)) - before[self.keypoint]
        if self.axis is not None:
            offset = np.where(np.arange(3) == self.axis, offset, 0.0)
        if self.other == self.keypoint:
            # It lies in the middle and stays there.
            offset = offset * (0.0, 1.0, 1.0)
        targets = {self.keypoint: before[self.keypoint] + offset}
        if self.other not in (None, self.keypoint):
            assert self.other is not None
            targets[self.other] = before[self.other] + offset * (-1.0, 1.0, 1.0)
        return targets


def check_keypoint(state: State, keypoint: int) -> None:
    """Refuse a number that no keypoint has.

    Raises:
        ConfigError: it is none of 0 to K - 1.
    """
    count = len(state.shape.keypoints)
    if not 0 <= keypoint < count:
        raise ConfigError(f"There is no keypoint {keypoint}; choose one of 0 to {count - 1}.")
