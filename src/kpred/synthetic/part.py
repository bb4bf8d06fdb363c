"""A labelled closed part of a piece of furniture and its rigid motions."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np

# Run-time type checkers take `float` at its word, so whole numbers are named beside it.
Number = float | int
Vector = Sequence[Number] | np.ndarray
_AXES = {"x": (1.0, 0.0, 0.0), "y": (0.0, 1.0, 0.0), "z": (0.0, 0.0, 1.0)}


def _identity() -> np.ndarray:
    return np.eye(3)


def rotation_matrix(axis: str | Vector, degrees: Number) -> np.ndarray:
    """Return the right-handed rotation (3, 3) by `degrees` about `axis` ("x", "y", "z" or a vector)."""
    direction = np.asarray(_AXES[axis] if isinstance(axis, str) else axis, dtype=np.float64)
    x, y, z = direction / np.linalg.norm(direction)
    angle = np.radians(degrees)
    cross = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    return np.eye(3) + np.sin(angle) * cross + (1.0 - np.cos(angle)) * (cross @ cross)


def rotation_between(source: Vector, target: Vector) -> np.ndarray:
    """Return the smallest rotation (3, 3) of the direction `source` to `target`."""
    a = np.asarray(source, dtype=np.float64)
    b = np.asarray(target, dtype=np.float64)
    a, b = a / np.linalg.norm(a), b / np.linalg.norm(b)
    axis = np.cross(a, b)
    sine, cosine = float(np.linalg.norm(axis)), float(a @ b)
    if sine < 1e-9:
        if cosine > 0.0:
            return np.eye(3)
        side = np.cross(a, (1.0, 0.0, 0.0) if abs(a[0]) < 0.9 else (0.0, 1.0, 0.0))
        return rotation_matrix(side, 180.0)
    return rotation_matrix(axis, float(np.degrees(np.arctan2(sine, cosine))))


@dataclass(frozen=True, eq=False)
class Part:
    """One closed surface with outward winding, in metres, y up, front +z.

    `vertices` (V, 3) float64, `faces` (F, 3) int64, `label` a word such as "leg".
    `axes` (3, 3): rows are the directions of the part's own box, carried along by rotations.
    `ring`: number of vertices in each cross-section when the part is a sweep (its vertices are the rings, one after
    the other; the middle of a ring's first side traces the sweep), else 0.
    """

    vertices: np.ndarray
    faces: np.ndarray
    label: str
    axes: np.ndarray = field(default_factory=_identity)
    ring: int = 0

    def moved(self, offset: Vector) -> Part:
        """Shift the part by `offset` (3,)."""
        return replace(self, vertices=self.vertices + np.asarray(offset, dtype=np.float64))

    def rotated(self, axis: str | Vector, degrees: Number, center: Vector = (0.0, 0.0, 0.0)) -> Part:
        """Rotate the part by degrees about the line through `center` along `axis` ("x", "y", "z", vector)."""
        turn = rotation_matrix(axis, degrees)
        pivot = np.asarray(center, dtype=np.float64)
        return replace(self, vertices=(self.vertices - pivot) @ turn.T + pivot, axes=self.axes @ turn.T)

    def scaled(self, factors: Number | Vector) -> Part:
        """Scale the part about the origin; `factors` is one positive number or three."""
        scale = np.broadcast_to(np.asarray(factors, dtype=np.float64), (3,))
        return replace(self, vertices=self.vertices * scale)

    def mirrored_x(self) -> Part:
        """Mirror the part at the plane x = 0, with winding kept outward."""
        flip = np.array([-1.0, 1.0, 1.0])
        return replace(self, vertices=self.vertices * flip, faces=self.faces[:, ::-1].copy(), axes=self.axes * flip)

    def relabelled(self, label: str) -> Part:
        """Return the same part under another label."""
        return replace(self, label=label)
