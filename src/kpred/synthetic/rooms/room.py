"""A furnished room: objects with meshes, categories, poses and amodal boxes."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from kpred.ops.rotations import yaw_rotation
from kpred.shapes.mesh import Mesh

OTHER = "other"
"""Category of things that are no chair, table or cabinet."""

STRUCTURE = "structure"
"""Category of floor, walls and ceiling."""


@dataclass(frozen=True, eq=False)
class RoomObject:
    """One object where it stands.

    Attributes:
        name: family, factory or word, such as `dining_slats`, `sofa_two`, `floor`.
        category: chair, table, cabinet, `OTHER` or `STRUCTURE`.
        mesh: in the object's own frame: metres, y up, front +z; furniture has its lowest point at y = 0 and its box
            centred in x and z.
        pose: (4, 4) rigid, for column vectors, from the object's frame to the room's.
        loss: fraction of depth readings that the material swallows (black, glossy).
    """

    name: str
    category: str
    mesh: Mesh
    pose: np.ndarray
    loss: float = 0.0

    @property
    def box(self) -> np.ndarray:
        """(2, 3) lowest and highest corner of the whole object in its own frame, metres."""
        vertices = np.asarray(self.mesh.vertices, dtype=np.float64)
        return np.stack([vertices.min(axis=0), vertices.max(axis=0)])

    def placed_vertices(self) -> np.ndarray:
        """Return the vertices (V, 3) in the room's frame, metres."""
        vertices = np.asarray(self.mesh.vertices, dtype=np.float64)
        return np.asarray(vertices @ self.pose[:3, :3].T + self.pose[:3, 3])


@dataclass(frozen=True, eq=False)
class Room:
    """A room: metres, y up, floor at y = 0, its middle at the origin.

    Attributes:
        size: (3,) width along x, height, depth along z.
        objects: structure, furniture and other things.
    """

    size: np.ndarray
    objects: list[RoomObject] = field(default_factory=list)

    def surfaces(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Join all meshes: vertices (V, 3) float32 metres, faces (F, 3) int32, object of each face (F,) int32."""
        return joined(self.objects)


def joined(objects: Sequence[RoomObject]) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Join meshes where they stand: vertices (V, 3) float32, faces (F, 3) int32, object of each face (F,) int32."""
    starts = np.cumsum([0, *(len(item.mesh.vertices) for item in objects)])
    vertices = np.concatenate([np.zeros((0, 3)), *(item.placed_vertices() for item in objects)])
    faces = [np.asarray(item.mesh.faces) + start for item, start in zip(objects, starts, strict=False)]
    owner = np.repeat(np.arange(len(objects)), [len(item.mesh.faces) for item in objects])
    joined_faces = np.concatenate([np.zeros((0, 3), np.int64), *faces])
    return vertices.astype(np.float32), joined_faces.astype(np.int32), owner.astype(np.int32)


def pose_of(x: float, y: float, z: float, yaw: float = 0.0) -> np.ndarray:
    """Make a (4, 4) pose at a place (metres), rotated by `yaw` radians about +y, which takes +z towards +x."""
    pose = np.eye(4)
    pose[:3, :3] = yaw_rotation(yaw)
    pose[:3, 3] = (x, y, z)
    return pose
