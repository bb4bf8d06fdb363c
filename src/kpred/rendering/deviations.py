"""How far the scan is from the result, point by point, as colours and as a sentence."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from kpred.ops.closest_point import closest_points
from kpred.ops.typing import Float, Int, UInt8

MAX_SHOWN, MIN_SHOWN = 8000, 1500
MAX_PAIRS = 3e7
"""Points of the scan that are shown: so many, or fewer where their distances to all faces would take long."""

FAR = 0.08
"""Distance that is drawn in the last colour, unit box: 4 % of the object's longest side."""

NEAR_COLOR, MIDDLE_COLOR, FAR_COLOR = (33, 102, 172), (247, 214, 96), (190, 24, 43)
"""Blue, yellow, red: clear to people who do not see red and green apart."""


@dataclass(frozen=True, eq=False)
class Deviations:
    """Distances from points of a scan to the surface of a result.

    Attributes:
        points: (N, 3), distances: (N,), the scan's unit box.
    """

    points: Float[np.ndarray, "points 3"]
    distances: Float[np.ndarray, " points"]

    @classmethod
    def measure(
        cls,
        points: Float[np.ndarray, "scan 3"],
        vertices: Float[np.ndarray, "vertices 3"],
        faces: Int[np.ndarray, "faces 3"],
    ) -> Deviations:
        """Measure the distances of some thousand points of a scan, all in its unit box."""
        shown = thinned(points, len(faces))
        return cls(shown, closest_points(shown, vertices, faces)[0])

    def colors(self) -> UInt8[np.ndarray, "points 3"]:
        """Color the points: blue on the surface, yellow halfway, red at `FAR` and beyond."""
        stops = np.array([NEAR_COLOR, MIDDLE_COLOR, FAR_COLOR], dtype=np.float64)
        place = np.clip(self.distances / FAR, 0.0, 1.0)
        mixed = [np.interp(place, (0.0, 0.5, 1.0), stops[:, channel]) for channel in range(3)]
        return np.stack(mixed, axis=1).round().astype(np.uint8)

    def sentence(self, centimetres: float) -> str:
        """Describe the distances; `centimetres` is the length of one unit of the unit box."""
        mean, most = (
            float(value) * centimetres for value in (self.distances.mean(), np.quantile(self.distances, 0.95))
        )
        return (
            f"Scan to result: {mean:.2g} cm on average, 95 % within {most:.2g} cm. "
            f"Blue is 0, yellow {FAR * centimetres / 2:.2g} cm, red {FAR * centimetres:.2g} cm and more."
        )


def thinned(points: Float[np.ndarray, "scan 3"], faces: int) -> Float[np.ndarray, "few 3"]:
    """Take evenly many points of a scan for a mesh of so many faces."""
    most = int(np.clip(MAX_PAIRS / max(faces, 1), MIN_SHOWN, MAX_SHOWN))
    return points[:: max(1, -(-len(points) // most))]
