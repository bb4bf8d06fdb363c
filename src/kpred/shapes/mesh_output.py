"""Writing meshes, whole or not at all, in the precision that their place needs: .obj .ply .stl .off .glb."""

from __future__ import annotations

import os
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from kpred.atomic import atomic_path
from kpred.errors import OutputError
from kpred.shapes.credit import Credit
from kpred.shapes.formats.obj import obj_lines
from kpred.shapes.formats.off import off_lines
from kpred.shapes.mesh import Mesh, clean_mesh
from kpred.shapes.precision import needs_double

if TYPE_CHECKING:
    import trimesh

OUTPUT_EXTENSIONS = (".obj", ".ply", ".stl", ".off", ".glb")

_TOLERANCE = 1e-4
"""Part of a mesh's extent by which rounding may move its vertices."""


def check_precision(path: str | os.PathLike[str], points: np.ndarray) -> None:
    """Refuse a format that cannot hold a mesh at the place of these points (N, 3).

    Raises:
        OutputError: STL, whose numbers are float32, and points too far from the origin for their extent.
    """
    if Path(path).suffix.lower() == ".stl" and needs_double(np.asarray(points, dtype=np.float64), _TOLERANCE):
        raise OutputError(
            f"Cannot write {path}: this far from the origin the numbers of .stl are too coarse; use .ply, .obj or .glb."
        )


def check_mesh(path: str | os.PathLike[str], mesh: Mesh | trimesh.Trimesh | trimesh.Scene) -> Mesh | trimesh.Trimesh:
    """Refuse what cannot be written to this file, and return the surface that is.

    Raises:
        OutputError: unknown extension, a mesh that is not finite, or a format that cannot hold it.
    """
    file = Path(path)
    extension = file.suffix.lower()
    if extension not in OUTPUT_EXTENSIONS:
        raise OutputError(
            f"Cannot write {file}: unknown extension {extension!r}; use one of {', '.join(OUTPUT_EXTENSIONS)}."
        )
    geometry = mesh if isinstance(mesh, Mesh) else _joined(mesh)
    vertices = geometry.vertices
    if not np.isfinite(vertices).all():
        raise OutputError(f"Cannot write {file}: the mesh has vertices that are NaN or infinite; fit it again.")
    check_precision(file, vertices)
    return geometry


def write_mesh(
    path: str | os.PathLike[str], mesh: Mesh | trimesh.Trimesh | trimesh.Scene, credit: Credit | None = None
) -> None:
    """Write a mesh, whole or not at all, in the format of the extension: .obj .ply .stl .off .glb.

    Parts are kept in .obj (as objects) and .glb (as nodes); the other formats hold one surface. Far from the origin
    .ply holds doubles, and .glb the place as a translation of its nodes. `credit` goes into comments (.obj, .ply, .off)
    and the asset (.glb); .stl has no place for it.

    Raises:
        OutputError: unknown extension, folder missing or not writable, disk full, a mesh that is not finite, or a
            format that cannot hold it.
    """
    file = Path(path)
    extension = file.suffix.lower()
    geometry = check_mesh(file, mesh)
    vertices = geometry.vertices
    with atomic_path(file) as temporary:
        if extension in (".obj", ".off"):
            parts = geometry.face_parts if isinstance(geometry, Mesh) else None
            digits = _digits(vertices)
            lines = (
                obj_lines(vertices, geometry.faces, parts, digits)
                if extension == ".obj"
                else off_lines(vertices, geometry.faces, digits)
            )
            comments = [f"# {line}\n" for line in credit.lines()] if credit is not None else []
            with open(temporary, "x", encoding="utf-8", newline="\n") as stream:
                # An OFF file begins with its keyword.
                stream.writelines([*comments, *lines] if extension == ".obj" else _after_first(lines, comments))
            return
        try:
            data = _export(mesh, geometry, extension.removeprefix("."), credit)
        except Exception as error:
            raise OutputError(f"Cannot write {file}: the mesh cannot be held by {extension}; use .ply.") from error
        with open(temporary, "xb") as binary:
            binary.write(data)


def _joined(mesh: trimesh.Trimesh | trimesh.Scene) -> trimesh.Trimesh:
    import trimesh

    return mesh.to_geometry() if isinstance(mesh, trimesh.Scene) else mesh


def _digits(vertices: np.ndarray) -> int:
    """Return the number of digits that preserve the coordinates: float32, or float64 far from the origin."""
    return 17 if vertices.dtype == np.float64 and needs_double(vertices, 1e-6) else 9


def _after_first(lines: Iterable[str], more: Iterable[str]) -> Iterator[str]:
    for number, line in enumerate(lines):
        yield line
        if number == 0:
            yield from more


def _export(
    mesh: Mesh | trimesh.Trimesh | trimesh.Scene, geometry: Mesh | trimesh.Trimesh, kind: str, credit: Credit | None
) -> bytes:
    import trimesh

    if kind == "ply":
        return _ply(np.asarray(geometry.vertices), np.asarray(geometry.faces), credit)
    exported: Any = geometry
    if kind == "glb":
        scene = mesh if isinstance(mesh, trimesh.Scene) else _glb_scene(geometry)
        entries = {} if credit is None else credit.asset()
        return bytes(scene.export(file_type="glb", tree_postprocessor=lambda tree: tree["asset"].update(entries)))
    if isinstance(geometry, Mesh):
        exported = trimesh.Trimesh(geometry.vertices, geometry.faces, process=False)
    data = exported.export(file_type=kind)
    return data.encode() if isinstance(data, str) else bytes(data)


def _ply(vertices: np.ndarray, faces: np.ndarray, credit: Credit | None) -> bytes:
    """Make a binary PLY file; coordinates are doubles where float32 would move them."""
    double = vertices.dtype == np.float64 and needs_double(vertices, _TOLERANCE)
    kind = "double" if double else "float"
    comments = [f"comment {line}\n" for line in credit.lines()] if credit is not None else []
    header = f"ply\nformat binary_little_endian 1.0\n{''.join(comments)}element vertex {len(vertices)}\n"
    header += "".join(f"property {kind} {axis}\n" for axis in "xyz")
    header += f"element face {len(faces)}\nproperty list uchar int vertex_indices\nend_header\n"
    records = np.empty(len(faces), dtype=[("length", "u1"), ("corners", "<i4", 3)])
    records["length"], records["corners"] = 3, faces
    return header.encode() + vertices.astype("<f8" if double else "<f4").tobytes() + records.tobytes()


def _glb_scene(mesh: Mesh | trimesh.Trimesh) -> trimesh.Scene:
    """Make a scene of one node a part; far from the origin the nodes carry the offset."""
    import trimesh

    vertices = np.asarray(mesh.vertices)
    place = np.eye(4)
    if vertices.dtype == np.float64 and needs_double(vertices, _TOLERANCE):
        place[:3, 3] = np.round((vertices.min(axis=0) + vertices.max(axis=0)) / 2)
    parts = mesh.face_parts if isinstance(mesh, Mesh) else None
    scene = trimesh.Scene()
    if parts is None:
        moved = trimesh.Trimesh(vertices - place[:3, 3], mesh.faces, process=False)
        scene.add_geometry(moved, node_name="mesh", geom_name="mesh", transform=place)
        return scene
    for part in np.unique(parts):
        piece = clean_mesh(Mesh(vertices - place[:3, 3], mesh.faces[parts == part]))
        name = f"part_{part:05d}"
        surface = trimesh.Trimesh(piece.vertices, piece.faces, process=False)
        scene.add_geometry(surface, node_name=name, geom_name=name, transform=place)
    return scene
