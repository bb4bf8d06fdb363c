"""A capture: depth pictures of one thing or room with the camera of each."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from kpred.ops.typing import Float
from kpred.shapes.intrinsics_file import IntrinsicsFile

GL_TO_CV = np.diag([1.0, -1.0, -1.0, 1.0])
"""Turns the axes of a camera with y up and z backward into y down and z forward."""


@dataclass(frozen=True, eq=False)
class Frame:
    """One depth picture and its camera.

    Attributes:
        depth: the picture's file.
        camera_to_world: (4, 4), x right, y down, z forward, metres.
        intrinsics: of the depth picture, or of a larger picture of the same view.
        confidence: file of how sure each pixel is, 0 to 2 (ARKit), or 0 to 255 (Polycam).
    """

    depth: Path
    camera_to_world: Float[np.ndarray, "4 4"]
    intrinsics: IntrinsicsFile
    confidence: Path | None = None


@dataclass(frozen=True, eq=False)
class Capture:
    """All frames of a folder whose poses are known.

    Attributes:
        kind: the program or data set whose layout it has.
        up: the world's up axis, as that program writes it; auto where it may be any.
        lost: depth pictures without a pose.
    """

    kind: str
    frames: tuple[Frame, ...]
    up: str
    lost: int = 0

    def spread(self, count: int) -> tuple[Frame, ...]:
        """Return at most `count` of the frames, evenly spread, the first and the last among them."""
        if len(self.frames) <= count:
            return self.frames
        rows = np.unique(np.linspace(0, len(self.frames) - 1, count).round().astype(int))
        return tuple(self.frames[row] for row in rows)
