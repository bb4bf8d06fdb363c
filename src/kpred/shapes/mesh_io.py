"""Mesh files in: .obj .ply .stl .off .glb .gltf .usd; `kpred.shapes.mesh_output` writes them."""

from __future__ import annotations

import os
from pathlib import Path

import numpy as np

from kpred.errors import MeshError
from kpred.shapes.formats.geometry import Geometry as Geometry
from kpred.shapes.formats.gltf import read_gltf
from kpred.shapes.formats.obj import read_obj
from kpred.shapes.formats.off import read_off
from kpred.shapes.formats.ply_mesh import read_ply_mesh
from kpred.shapes.formats.stl import read_stl
from kpred.shapes.formats.usd import USD_EXTENSIONS, read_usd
from kpred.shapes.mesh import Mesh, clean_mesh
from kpred.shapes.mesh_output import OUTPUT_EXTENSIONS as OUTPUT_EXTENSIONS
from kpred.shapes.mesh_output import write_mesh as write_mesh
from kpred.shapes.reading import check_file, reading

MESH_EXTENSIONS = (".obj", ".ply", ".stl", ".off", ".glb", ".gltf", *USD_EXTENSIONS)

# float32 keeps 24 bits: beyond this distance, in sizes of the object, its surface would move by 0.1 % of that size.
_MAX_DISTANCE = 1e4


def read_mesh(path: str | os.PathLike[str]) -> Mesh:
    """Read a mesh file as one triangle mesh in the file's own frame and unit.

    Parts (objects and groups of an OBJ, nodes of a GLB or glTF with their transforms applied) are joined;
    ``face_parts`` numbers them when there are several. Quads and polygons become triangles; faces
    without area are dropped; materials, textures and a missing .mtl are ignored.

    Raises:
        MeshError: missing, unreadable, unknown extension, no face with an area, or too far from its origin.
    """
    return clean_mesh(read_whole_mesh(path))


def read_whole_mesh(path: str | os.PathLike[str]) -> Mesh:
    """Read a mesh file like `read_mesh`, with the faces and vertices that it drops.

    Raises:
        MeshError: missing, unreadable, unknown extension, no face, or too far from its origin.
    """
    file = Path(path)
    geometry = read_geometry(file)
    if not len(geometry.faces):
        raise MeshError(f"{file}: it has no faces; give a surface mesh, not a point cloud or an empty file.")
    _check_distance(geometry.vertices[geometry.faces].reshape(-1, 3), file)
    parts = geometry.parts
    # More parts than int16 can number are not parts in any useful sense.
    several = len(parts) and parts.min() != parts.max() and parts.max() < np.iinfo(np.int16).max
    with np.errstate(over="ignore"):
        vertices = geometry.vertices.astype(np.float32)
    return Mesh(vertices, geometry.faces, str(file), parts.astype(np.int16) if several else None)


def read_geometry(path: Path) -> Geometry:
    """Read positions and triangles of a mesh file in float64, without dropping anything.

    Raises:
        MeshError: missing, unreadable, or unknown extension.
    """
    extension = path.suffix.lower()
    if extension not in MESH_EXTENSIONS:
        raise MeshError(f"{path}: unknown mesh extension {extension!r}; convert it to {', '.join(MESH_EXTENSIONS)}.")
    check_file(path, MeshError, "mesh file")
    with reading(path, MeshError):
        if extension == ".obj":
            return read_obj(path)
        if extension in (".glb", ".gltf"):
            return read_gltf(path)
        if extension == ".ply":
            return read_ply_mesh(path)
        if extension in USD_EXTENSIONS:
            return read_usd(path)
        vertices, faces = read_off(path) if extension == ".off" else read_stl(path)
        return Geometry(vertices, faces, np.zeros(len(faces), dtype=np.int64))


def _check_distance(points: np.ndarray, path: Path) -> None:
    finite = points[np.isfinite(points).all(axis=1)]
    if not len(finite):
        return
    low, high = finite.min(axis=0), finite.max(axis=0)
    if max(np.abs(low).max(), np.abs(high).max()) > _MAX_DISTANCE * (high - low).max() > 0:
        raise MeshError(
            f"{path}: it lies so far from its origin that single precision would spoil it; move it to the origin."
        )
