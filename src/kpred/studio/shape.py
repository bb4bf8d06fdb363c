"""The shape of a result while it is corrected by hand: what every kind of it can do."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field

import numpy as np

from kpred.ops.typing import Float

Place = Float[np.ndarray, "3"]

SEEN_DISTANCE = 0.12
"""Surface of a result that has no point of the scan within this distance is taken for unseen; unit box."""


@dataclass(frozen=True, eq=False)
class Held:
    """What stays as a person has set it while the rest of a shape changes; the scan's unit box.

    Attributes:
        pins: places of pinned keypoints; sizes: lengths of parts (`WHOLE`: of the object) along axes 0 to 2.
    """

    pins: Mapping[int, Place] = field(default_factory=dict)
    sizes: Mapping[tuple[int, int], float] = field(default_factory=dict)


class Shape(ABC):
    """A deformed model in the scan's unit box, immutable; each change makes another."""

    @property
    @abstractmethod
    def vertices(self) -> Float[np.ndarray, "vertices 3"]:
        """Vertices of the mesh."""

    @property
    @abstractmethod
    def keypoints(self) -> Float[np.ndarray, "keypoints 3"]:
        """Keypoints of the model."""

    @abstractmethod
    def pull(self, keypoints: tuple[int, ...], held: Held) -> Callable[[Float[np.ndarray, "moved 3"]], Shape]:
        """Make ready to drag some keypoints; the function gives the shape for their new places, quickly."""

    @abstractmethod
    def refit(self, goal: Float[np.ndarray, "goal 3"], held: Held) -> Shape:
        """Fit everything that is not held to the points of the scan."""

    @abstractmethod
    def sizes(self, part: int) -> Float[np.ndarray, "3"]:
        """Measure the sides of a part, or of the whole object, along the axes."""

    @abstractmethod
    def resize(self, part: int, axis: int, length: float, held: Held) -> Shape:
        """Give a part, or the whole object, a length along an axis.

        Raises:
            ConfigError: this shape has no parts, or they cannot become so long.
        """
