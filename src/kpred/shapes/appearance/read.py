"""Reading a mesh together with what its file holds beside positions."""

from __future__ import annotations

import os
from collections.abc import Callable
from pathlib import Path

import numpy as np

from kpred.errors import MeshError
from kpred.ops.typing import Float, Int
from kpred.shapes.appearance.appearance import Appearance, map_vertices
from kpred.shapes.appearance.gltf_template import read_gltf_template
from kpred.shapes.appearance.obj_template import read_obj_template
from kpred.shapes.mesh import Mesh, clean_mesh_rows
from kpred.shapes.mesh_io import read_whole_mesh

Stand = Callable[[Mesh], Mesh]
"""Rotates and scales a mesh; its vertices stay in order."""


def read_mesh_appearance(path: str | os.PathLike[str], stand: Stand | None = None) -> tuple[Mesh, Appearance | None]:
    """Read a mesh like `kpred.shapes.read_mesh`, stood up, and its appearance.

    The appearance is None for formats other than OBJ and glTF, for OBJ files that have none, and for files whose
    positions cannot be replaced.

    Raises:
        MeshError: the mesh cannot be read.
    """
    file = Path(path)
    whole = read_whole_mesh(file)
    stood = whole if stand is None else stand(whole)
    mesh, kept = clean_mesh_rows(stood)
    try:
        return mesh, _appearance(file, whole, stood, kept)
    except (MeshError, ValueError, KeyError, IndexError, TypeError, AttributeError, OSError):
        # The mesh itself could be read: odd materials must not cost a model.
        return mesh, None


def _appearance(file: Path, whole: Mesh, stood: Mesh, kept: Int[np.ndarray, " kept"]) -> Appearance | None:
    places = np.full(len(stood.vertices), -1)
    places[kept] = np.arange(len(kept))
    rotation, scale = _similarity(whole, stood)
    extension = file.suffix.lower()
    if extension == ".obj":
        files, count = read_obj_template(file)
        if not files or count != len(stood.vertices):
            return None
        rows, positions = places, stood.vertices.astype(np.float64)
    elif extension in (".glb", ".gltf"):
        template = read_gltf_template(file)
        files, read = template.files, template.rows
        if len(stood.vertices) != read.max(initial=-1) + 1:
            return None
        rows = np.where(read >= 0, places[np.maximum(read, 0)], -1)
        positions = scale * template.positions @ rotation.T
    else:
        return None
    vertex_map, offsets = map_vertices(positions, rows, stood.vertices[kept].astype(np.float64))
    return Appearance("obj" if extension == ".obj" else "gltf", files, vertex_map, offsets, rotation)


def _similarity(whole: Mesh, stood: Mesh) -> tuple[Float[np.ndarray, "3 3"], float]:
    """Rotation and scale from one to the other; one is the other turned about the origin and scaled."""
    if stood is whole:
        return np.eye(3), 1.0
    left, right = (mesh.vertices[np.unique(mesh.faces)].astype(np.float64) for mesh in (whole, stood))
    finite = np.isfinite(left).all(axis=1)
    left, right = left[finite], right[finite]
    scale = float(np.linalg.norm(right) / np.linalg.norm(left))
    u, _, vt = np.linalg.svd(right.T @ left)
    flip = np.diag([1.0, 1.0, np.linalg.det(u @ vt)])
    return u @ flip @ vt, scale
