"""A triangle mesh: plain arrays, nothing but numpy."""

from __future__ import annotations

import hashlib
from dataclasses import dataclass

import numpy as np

from kpred.errors import MeshError
from kpred.ops.typing import Float


@dataclass(frozen=True, eq=False)
class Mesh:
    """A triangle soup: parts may overlap, surfaces need not be closed, winding is not relied on.

    Attributes:
        vertices: (V, 3) float32, in whatever frame and unit the source has (packs: metres, y up, front +z).
        faces: (F, 3) int32, rows of ``vertices``.
        name: for messages; may be empty.
        face_parts: (F,) int16 part index of each face, or None when the mesh has no parts.

    Raises:
        MeshError: an array has a wrong shape, or a face names a vertex that is not there.
    """

    vertices: np.ndarray
    faces: np.ndarray
    name: str = ""
    face_parts: np.ndarray | None = None

    def __post_init__(self) -> None:
        vertices = np.ascontiguousarray(self.vertices, dtype=np.float32)
        given_faces = np.asarray(self.faces)
        label = self.name or "mesh"
        if vertices.ndim != 2 or vertices.shape[1] != 3:
            raise MeshError(f"{label}: vertices must have shape (V, 3), not {vertices.shape}.")
        if given_faces.ndim != 2 or given_faces.shape[1] != 3:
            raise MeshError(f"{label}: faces must have shape (F, 3), not {given_faces.shape}; triangulate it first.")
        if len(given_faces) and (given_faces.min() < 0 or given_faces.max() >= len(vertices)):
            raise MeshError(f"{label}: a face names a vertex that does not exist; export the mesh again.")
        object.__setattr__(self, "vertices", vertices)
        object.__setattr__(self, "faces", np.ascontiguousarray(given_faces, dtype=np.int32))
        if self.face_parts is not None:
            parts = np.ascontiguousarray(self.face_parts, dtype=np.int16)
            if parts.shape != (len(given_faces),):
                raise MeshError(f"{label}: face_parts must have one entry a face, not shape {parts.shape}.")
            object.__setattr__(self, "face_parts", parts)

    @property
    def bounds(self) -> Float[np.ndarray, "2 3"]:
        """(2, 3) float32: lowest and highest coordinates of the axis-aligned box of all vertices.

        Raises:
            MeshError: the mesh has no vertices.
        """
        if not len(self.vertices):
            raise MeshError(f"{self.name or 'mesh'}: it has no vertices, so it has no bounds.")
        return np.stack([self.vertices.min(axis=0), self.vertices.max(axis=0)])

    def face_areas(self) -> Float[np.ndarray, " faces"]:
        """Compute the area (F,) float64 of each face, in squared units of the vertices."""
        # float64 and differences first: far from the origin float32 products would cancel.
        corners = self.vertices[self.faces].astype(np.float64)
        with np.errstate(invalid="ignore", over="ignore"):
            normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
            areas: np.ndarray = 0.5 * np.linalg.norm(normals, axis=1)
        return areas

    def area(self) -> float:
        """Sum of the face areas, in squared units of the vertices."""
        return float(self.face_areas().sum())


def clean_mesh(mesh: Mesh) -> Mesh:
    """Drop faces of zero area or with a NaN or infinite corner, then vertices that no face uses.

    Order of faces and of vertices is kept, ``name`` and ``face_parts`` are carried along.

    Raises:
        MeshError: no face is left.
    """
    return clean_mesh_rows(mesh)[0]


def clean_mesh_rows(mesh: Mesh) -> tuple[Mesh, np.ndarray]:
    """Clean a mesh like `clean_mesh`, and return the rows of the vertices that are left too.

    Raises:
        MeshError: no face is left.
    """
    areas = mesh.face_areas()
    finite = np.isfinite(mesh.vertices).all(axis=1)
    keep = finite[mesh.faces].all(axis=1) & np.isfinite(areas) & (areas > 0.0)
    if not keep.any():
        label = mesh.name or "mesh"
        raise MeshError(f"{label}: it has no face with an area; give a mesh with at least one proper triangle.")
    faces = mesh.faces[keep]
    used = np.zeros(len(mesh.vertices), dtype=bool)
    used[faces] = True
    renumbered = np.cumsum(used, dtype=np.int64) - 1
    parts = None if mesh.face_parts is None else mesh.face_parts[keep]
    return Mesh(mesh.vertices[used], renumbered[faces], mesh.name, parts), np.flatnonzero(used)


def mesh_hash(mesh: Mesh) -> str:
    """Hash vertices and faces, equal for identical meshes; 16 hexadecimal digits."""
    total = hashlib.sha256()
    for array, dtype in ((mesh.vertices, "<f4"), (mesh.faces, "<i4")):
        total.update(np.asarray(array.shape, dtype="<i8").tobytes())
        total.update(array.astype(dtype).tobytes())
    return total.hexdigest()[:16]
