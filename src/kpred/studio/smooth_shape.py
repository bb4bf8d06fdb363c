"""A shape that bends smoothly with its keypoints, as results of `--deform free` and `paper` do."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from kpred.errors import ConfigError
from kpred.ops.typing import Float
from kpred.studio.gestures import WHOLE
from kpred.studio.refit import match, near
from kpred.studio.shape import Held, Shape

ROUNDS = 10
KEEP = 0.02
"""Weight of the squared motion of keypoints, beside which that of all matches is 2."""


@dataclass(frozen=True, eq=False)
class SmoothModel:
    """A model as it was deformed, and how it follows its keypoints.

    Attributes:
        vertices: (V, 3), keypoints: (K, 3), samples: (N, 3), the scan's unit box.
        vertex_basis: (V, K); sample_basis: (N, K).
    """

    vertices: Float[np.ndarray, "vertices 3"]
    keypoints: Float[np.ndarray, "keypoints 3"]
    samples: Float[np.ndarray, "samples 3"]
    vertex_basis: Float[np.ndarray, "vertices keypoints"]
    sample_basis: Float[np.ndarray, "samples keypoints"]


@dataclass(frozen=True, eq=False)
class SmoothShape(Shape):
    """A model bent by displaced keypoints.

    Attributes:
        model: as it was; displacement: (K, 3) of its keypoints.
    """

    model: SmoothModel
    displacement: Float[np.ndarray, "keypoints 3"]

    @cached_property
    def vertices(self) -> Float[np.ndarray, "vertices 3"]:
        """Vertices of the mesh."""
        return self.model.vertices + self.model.vertex_basis @ self.displacement

    @property
    def keypoints(self) -> Float[np.ndarray, "keypoints 3"]:
        """Keypoints of the model."""
        return self.model.keypoints + self.displacement

    def pull(self, keypoints: tuple[int, ...], held: Held) -> Callable[[Float[np.ndarray, "moved 3"]], SmoothShape]:
        """Make ready to drag some keypoints; the others stay."""
        chosen = list(keypoints)

        def at(places: np.ndarray) -> SmoothShape:
            moved = self.displacement.copy()
            moved[chosen] = places - self.model.keypoints[chosen]
            return replace(self, displacement=moved)

        return at

    def refit(self, goal: Float[np.ndarray, "goal 3"], held: Held) -> SmoothShape:
        """Move the keypoints that are not pinned so that the shape lies on the points of the scan."""
        model, displacement = self.model, self.displacement.copy()
        for pin, place in held.pins.items():
            displacement[pin] = place - model.keypoints[pin]
        free = [one for one in range(len(displacement)) if one not in held.pins]
        if not free:
            return replace(self, displacement=displacement)
        rows, target = model.sample_basis[:, free], np.ascontiguousarray(goal, dtype=np.float32)
        seen = near(model.samples + model.sample_basis @ displacement, target)
        for _ in range(ROUNDS):
            moved = model.samples + model.sample_basis @ displacement
            pull, weight = match(moved, target, seen)
            normal = rows.T @ (weight[:, None] * rows) + KEEP * np.eye(len(free))
            displacement[free] += np.linalg.solve(normal, rows.T @ pull)
        return replace(self, displacement=displacement)

    def sizes(self, part: int) -> Float[np.ndarray, "3"]:
        """Measure the sides of the whole object; a bent shape has no parts."""
        if part != WHOLE:
            raise _no_parts()
        return np.ptp(self.vertices, axis=0)

    def resize(self, part: int, axis: int, length: float, held: Held) -> SmoothShape:
        """Refuse: a bent shape has no parts whose size could be set."""
        raise _no_parts()


def _no_parts() -> ConfigError:
    return ConfigError("Sizes cannot be set in the deform modes free and paper; choose auto or structure first.")
