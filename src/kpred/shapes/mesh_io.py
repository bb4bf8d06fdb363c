"""Mesh files in and out: .obj .ply .stl .off .glb, and .gltf in."""

from __future__ import annotations

import os
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from kpred.errors import MeshError, OutputError
from kpred.shapes.atomic import atomic_path
from kpred.shapes.mesh import Mesh, clean_mesh
from kpred.shapes.obj import obj_lines, read_obj
from kpred.shapes.off import off_lines, read_off

if TYPE_CHECKING:
    import trimesh

MESH_EXTENSIONS = (".obj", ".ply", ".stl", ".off", ".glb", ".gltf")
OUTPUT_EXTENSIONS = (".obj", ".ply", ".stl", ".off", ".glb")

# float32 keeps 24 bits: beyond this distance, in sizes of the object, its surface would move by 0.1 % of that size.
_FARTHEST = 1e4


@dataclass(frozen=True, eq=False)
class Geometry:
    """A file's geometry in double precision: (V, 3) vertices, (F, 3) faces (none for a point cloud), (F,) parts."""

    vertices: np.ndarray
    faces: np.ndarray
    parts: np.ndarray


def read_mesh(path: str | os.PathLike[str]) -> Mesh:
    """Read a mesh file as one triangle mesh in the file's own frame and unit.

    Parts (objects and groups of an OBJ, nodes of a GLB or glTF with their transforms applied) are joined;
    ``face_parts`` tells them apart when there are several. Quads and polygons become triangles; faces
    without area are dropped; materials, textures and a missing .mtl are ignored.

    Raises:
        MeshError: missing, unreadable, unknown extension, no face with an area, or too far from its origin.
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
    return clean_mesh(Mesh(vertices, geometry.faces, str(file), parts.astype(np.int16) if several else None))


def read_geometry(path: Path) -> Geometry:
    """Read positions and triangles of a mesh file in float64, without dropping anything.

    Raises:
        MeshError: missing, unreadable, or unknown extension.
    """
    extension = path.suffix.lower()
    if extension not in MESH_EXTENSIONS:
        raise MeshError(f"{path}: unknown mesh extension {extension!r}; convert it to {', '.join(MESH_EXTENSIONS)}.")
    if path.is_dir():
        raise MeshError(f"{path}: it is a folder; give a mesh file.")
    if not path.exists():
        raise MeshError(f"{path}: there is no such file; check the path.")
    if not path.stat().st_size:
        raise MeshError(f"{path}: the file is empty; export the mesh again.")
    try:
        if extension == ".obj":
            return Geometry(*read_obj(path))
        if extension == ".off":
            vertices, faces = read_off(path)
            return Geometry(vertices, faces, np.zeros(len(faces), dtype=np.int64))
        if extension == ".stl":
            _check_stl_end(path)
        return _read_with_trimesh(path)
    except OSError as error:
        reason = error.strerror or str(error)
        raise MeshError(f"{path}: it cannot be read ({reason}); check the file and those it refers to.") from error


def _read_with_trimesh(path: Path) -> Geometry:
    import trimesh

    try:
        scene = trimesh.load_scene(path, process=False)
        blocks = list(_placed(scene))
    except (OSError, MeshError):
        raise
    except Exception as error:  # A parser of foreign bytes may fail in any way.
        kind = path.suffix.lower()
        raise MeshError(f"{path}: it is not a readable {kind} file (damaged or cut short); export it again.") from error
    vertices, faces, parts, count = [np.zeros((0, 3))], [np.zeros((0, 3), np.int64)], [np.zeros(0, np.int64)], 0
    for number, (points, triangles) in enumerate(blocks):
        vertices.append(points)
        faces.append(triangles + count)
        parts.append(np.full(len(triangles), number, dtype=np.int64))
        count += len(points)
    joined = np.concatenate(faces)
    if len(joined) and (joined.min() < 0 or joined.max() >= count):
        raise MeshError(f"{path}: a face names a vertex that does not exist; export the mesh again.")
    geometry = Geometry(np.concatenate(vertices), joined, np.concatenate(parts))
    return _welded(geometry) if path.suffix.lower() == ".stl" else geometry


def _check_stl_end(path: Path) -> None:
    """The STL parser takes what is there, so whether a file is whole has to be seen before."""
    size = path.stat().st_size
    with open(path, "rb") as stream:
        head = stream.read(84)
        stream.seek(max(0, size - 1024))
        tail = stream.read()
    if len(head) == 84 and size >= 84 + 50 * int.from_bytes(head[80:], "little"):
        return
    if not (head.lstrip()[:5].lower() == b"solid" and b"endsolid" in tail.lower()):
        raise MeshError(f"{path}: it is not a whole STL file (damaged or cut short); copy or export it again.")


def _placed(scene: Any) -> Any:
    """Yield vertices and faces of each geometry as often as the scene shows it, with its transform applied."""
    for node in sorted(scene.graph.nodes_geometry):
        transform, name = scene.graph[node]
        geometry = scene.geometry[name]
        if not hasattr(geometry, "vertices") or hasattr(geometry, "entities"):
            continue  # Lines and other drawings.
        vertices = np.asarray(geometry.vertices, dtype=np.float64).reshape(-1, 3)
        faces = np.asarray(getattr(geometry, "faces", np.zeros((0, 3))), dtype=np.int64).reshape(-1, 3)
        if not np.array_equal(transform, np.eye(4)):
            vertices = vertices @ transform[:3, :3].T + transform[:3, 3]
            if np.linalg.det(transform[:3, :3]) < 0:
                faces = faces[:, ::-1]
        yield vertices, faces


def _welded(geometry: Geometry) -> Geometry:
    """Join vertices at exactly the same place: an STL repeats every vertex in each of its faces."""
    if not len(geometry.vertices):
        return geometry
    vertices = geometry.vertices + 0.0  # -0.0 becomes 0.0
    order = np.lexsort(vertices.T)
    ordered = vertices[order]
    first = np.concatenate([[True], (ordered[1:] != ordered[:-1]).any(axis=1)])
    renumbered = np.empty(len(vertices), dtype=np.int64)
    renumbered[order] = np.cumsum(first) - 1
    return Geometry(ordered[first], renumbered[geometry.faces], geometry.parts)


def _check_distance(points: np.ndarray, path: Path) -> None:
    finite = points[np.isfinite(points).all(axis=1)]
    if not len(finite):
        return
    low, high = finite.min(axis=0), finite.max(axis=0)
    if max(np.abs(low).max(), np.abs(high).max()) > _FARTHEST * (high - low).max() > 0:
        raise MeshError(
            f"{path}: it lies so far from its origin that single precision would spoil it; move it to the origin."
        )


def write_mesh(path: str | os.PathLike[str], mesh: Mesh | trimesh.Trimesh | trimesh.Scene) -> None:
    """Write a mesh, whole or not at all, in the format of the extension: .obj .ply .stl .off .glb.

    Parts are kept in .obj (as objects) and .glb (as nodes); the other formats hold one surface.

    Raises:
        OutputError: unknown extension, folder missing or not writable, disk full, or a format that cannot hold it.
    """
    file = Path(path)
    extension = file.suffix.lower()
    if extension not in OUTPUT_EXTENSIONS:
        raise OutputError(
            f"Cannot write {file}: unknown extension {extension!r}; use one of {', '.join(OUTPUT_EXTENSIONS)}."
        )
    with atomic_path(file) as temporary:
        if isinstance(mesh, Mesh) and extension in (".obj", ".off"):
            with open(temporary, "x", encoding="ascii", newline="\n") as stream:
                if extension == ".obj":
                    stream.writelines(obj_lines(mesh.vertices, mesh.faces, mesh.face_parts))
                else:
                    stream.writelines(off_lines(mesh.vertices, mesh.faces))
            return
        try:
            data = _export(mesh, extension.removeprefix("."))
        except Exception as error:
            raise OutputError(f"Cannot write {file}: the mesh cannot be held by {extension}; use .ply.") from error
        with open(temporary, "xb") as binary:
            binary.write(data)


def _export(mesh: Mesh | trimesh.Trimesh | trimesh.Scene, kind: str) -> bytes:
    import trimesh

    exported: Any = mesh
    if isinstance(mesh, Mesh):
        whole = trimesh.Trimesh(mesh.vertices, mesh.faces, process=False)
        exported = whole
        if kind == "glb" and mesh.face_parts is not None:
            exported = trimesh.Scene()
            for part in np.unique(mesh.face_parts):
                piece = clean_mesh(Mesh(mesh.vertices, mesh.faces[mesh.face_parts == part]))
                name = f"part_{part:05d}"
                exported.add_geometry(
                    trimesh.Trimesh(piece.vertices, piece.faces, process=False), node_name=name, geom_name=name
                )
    elif isinstance(mesh, trimesh.Scene) and kind not in ("glb", "obj"):
        exported = mesh.to_geometry()
    data = exported.export(file_type=kind)
    return data.encode() if isinstance(data, str) else bytes(data)
