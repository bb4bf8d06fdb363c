"""Furniture as rigid bodies: colliders by part, mass and inertia."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
import trimesh
from scipy.spatial import ConvexHull, QhullError

from kpred.exports.furniture import FRONT_X, Export, Furniture, moved
from kpred.ops.typing import Float, Int

BOX_FILL = 0.95
"""A part is a box where its convex hull fills this fraction of it."""

MIN_THICKNESS = 0.001
"""Thickness of the collider of a part without any, metres."""


@dataclass(frozen=True, eq=False)
class Collider:
    """A convex solid that stands for one part, in the object's own frame, metres.

    Attributes:
        center: (3,), rotation: (3, 3), size: (3,) of its box, whose axes are the columns of `rotation`.
        hull: (n, 3) vertices and (m, 3) faces of a convex hull in place of the box; None where it is the box.
        volume: of the solid; mass_center: (3,); inertia: (3, 3) about it, at a density of one.
    """

    center: Float[np.ndarray, "3"]
    rotation: Float[np.ndarray, "3 3"]
    size: Float[np.ndarray, "3"]
    hull: tuple[Float[np.ndarray, "n 3"], Int[np.ndarray, "m 3"]] | None
    volume: float
    mass_center: Float[np.ndarray, "3"]
    inertia: Float[np.ndarray, "3 3"]

    def lowest(self) -> float:
        """Return its lowest height."""
        if self.hull is not None:
            return float(self.hull[0][:, 2].min())
        return float(self.center[2] - np.abs(self.rotation[2]) @ self.size / 2)


@dataclass(frozen=True, eq=False)
class Body:
    """A rigid body in its own frame (`Export.body_frame`), metres and kilograms.

    Attributes:
        name, pose: (4, 4) from its own frame to z up.
        colliders: one a part; mass, center: (3,) and inertia: (3, 3) about the centre of mass.
    """

    name: str
    pose: Float[np.ndarray, "4 4"]
    colliders: tuple[Collider, ...]
    mass: float
    center: Float[np.ndarray, "3"]
    inertia: Float[np.ndarray, "3 3"] = field(repr=False)

    def floor(self) -> float:
        """Return the height, z up, of what it stands on: that of its lowest collider."""
        return float(self.pose[2, 3]) + min(one.lowest() for one in self.colliders)


def body_of(export: Export, furniture: Furniture) -> Body:
    """Make the rigid body of an object: a box or a convex hull for each part of its structure."""
    own = moved(export.scan_to_body(furniture), furniture.vertices)
    colliders = []
    for part in np.unique(furniture.parts):
        points = own[furniture.parts == part]
        axes = furniture.axes[int(part)] @ FRONT_X.T if int(part) < len(furniture.axes) else np.eye(3)
        colliders.append(_collider(points, axes))
    masses = np.array([export.density * one.volume for one in colliders])
    mass = float(masses.sum())
    center = (masses[:, None] * np.array([one.mass_center for one in colliders])).sum(axis=0) / mass
    inertia = np.zeros((3, 3))
    for one, weight in zip(colliders, masses, strict=True):
        away = one.mass_center - center
        inertia += export.density * one.inertia + weight * (away @ away * np.eye(3) - np.outer(away, away))
    return Body(furniture.name, export.body_frame(furniture), tuple(colliders), mass, center, inertia)


def bodies_of(export: Export) -> tuple[Body, ...]:
    """Make the rigid bodies of all objects."""
    return tuple(body_of(export, one) for one in export.objects)


def _collider(points: np.ndarray, axes: np.ndarray) -> Collider:
    """Bound the points of a part by the smallest of some boxes, or by their hull where that is no box."""
    center, rotation, size = min((_box(points, one) for one in (np.eye(3), axes)), key=lambda box: float(box[2].prod()))
    box = Collider(center, rotation, size, None, *_solid_box(center, rotation, size))
    hull = _hull(points)
    if hull is None or hull.volume >= BOX_FILL * box.volume:
        return box
    inertia = np.asarray(hull.moment_inertia)
    vertices, faces = np.asarray(hull.vertices), np.asarray(hull.faces, dtype=np.int64)
    return Collider(
        center, rotation, size, (vertices, faces), float(hull.volume), np.asarray(hull.center_mass), inertia
    )


def _box(points: np.ndarray, axes: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    along = points @ axes.T
    low, high = along.min(axis=0), along.max(axis=0)
    if np.linalg.det(axes) < 0:
        axes = axes * [[1.0], [1.0], [-1.0]]
        low, high = np.array([*low[:2], -high[2]]), np.array([*high[:2], -low[2]])
    return axes.T @ ((low + high) / 2), axes.T, np.maximum(high - low, MIN_THICKNESS)


def _solid_box(center: np.ndarray, rotation: np.ndarray, size: np.ndarray) -> tuple[float, np.ndarray, np.ndarray]:
    volume = float(size.prod())
    squares = size**2
    return volume, center, rotation @ np.diag(volume / 12 * (squares.sum() - squares)) @ rotation.T


def _hull(points: np.ndarray) -> trimesh.Trimesh | None:
    """Return the convex hull; None of points that are flat."""
    try:
        found = ConvexHull(points)
    except (QhullError, ValueError):
        return None
    used, faces = np.unique(found.simplices, return_inverse=True)
    hull = trimesh.Trimesh(points[used], faces.reshape(-1, 3), process=False)
    hull.fix_normals()
    return hull if hull.volume > MIN_THICKNESS**3 and np.ptp(points, axis=0).min() > 0 else None
