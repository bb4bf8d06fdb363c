"""Similarity frames: from a scan's own place and units into the unit box, and exactly back."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any, TypeVar

import numpy as np
import torch
from torch import Tensor

from kpred.errors import ScanError

Points = TypeVar("Points", np.ndarray, Tensor)


def _identity() -> np.ndarray:
    return np.eye(3)


@dataclass(frozen=True, eq=False)
class Frame:
    """A similarity between the outside world and the unit box: x_unit = rotation @ (x - center) / scale.

    Attributes:
        center: (3,) float64, in the outside units; the point that becomes the origin.
        scale: outside units per unit-box unit, > 0.
        rotation: (3, 3) float64, proper rotation from outside axes to the canonical axes (y up, front +z).
    """

    center: np.ndarray
    scale: float
    rotation: np.ndarray = field(default_factory=_identity)

    def __post_init__(self) -> None:
        if not (np.isfinite(self.scale) and self.scale > 0):
            raise ScanError(f"A frame needs a positive scale, but got {self.scale}; is the cloud a single point?")

    def to_unit(self, points: Points) -> Points:
        """Transform outside points (..., 3) to unit-box points (..., 3), same array type and dtype."""
        rotation, center = self._like(points)
        return ((points - center) @ rotation.T) / self.scale

    def from_unit(self, points: Points) -> Points:
        """Transform unit-box points (..., 3) to outside points (..., 3), same array type and dtype."""
        rotation, center = self._like(points)
        return (points * self.scale) @ rotation + center

    def matrix(self) -> np.ndarray:
        """Return the 4x4 matrix (column vectors) from unit-box coordinates to the outside world."""
        matrix = np.eye(4)
        matrix[:3, :3] = self.rotation.T * self.scale
        matrix[:3, 3] = self.center
        return matrix

    def _like(self, points: Points) -> tuple[Points, Points]:
        if isinstance(points, Tensor):
            options: dict[str, Any] = {"dtype": points.dtype, "device": points.device}
            return torch.as_tensor(self.rotation, **options), torch.as_tensor(self.center, **options)
        dtype = points.dtype if points.dtype.kind == "f" else np.float64
        return self.rotation.astype(dtype), self.center.astype(dtype)


def unit_box_frame(points: np.ndarray, rotation: np.ndarray | None = None) -> Frame:
    """Return the frame of the axis-aligned box of `points` (N, 3) after `rotation` (3, 3).

    Centre = middle of the box, scale = largest absolute coordinate after centring, so that the points fill [-1, 1]^3.

    Raises:
        ScanError: if there are no points, a coordinate is not finite, or all points coincide.
    """
    points = np.asarray(points, dtype=np.float64)
    if points.ndim != 2 or points.shape[1] != 3 or len(points) == 0:
        raise ScanError(f"Points must be an (N, 3) array with N > 0, but have shape {points.shape}.")
    if not np.isfinite(points).all():
        raise ScanError("Points hold NaN or infinite coordinates; remove those rows first.")
    rotation = np.eye(3) if rotation is None else np.asarray(rotation, dtype=np.float64)
    rotated = points @ rotation.T
    low, high = rotated.min(axis=0), rotated.max(axis=0)
    scale = float((high - low).max() / 2)
    if scale <= 0:
        raise ScanError("All points of the cloud coincide, so it has no size; give a scan of an object.")
    return Frame(center=((low + high) / 2) @ rotation, scale=scale, rotation=rotation)
