"""OBJ with its materials, PLY, STL and OFF: the surface in the scan's own frame and unit."""

from __future__ import annotations

from pathlib import Path

from kpred.exports.furniture import Export
from kpred.exports.writer import Writer, bytes_writer
from kpred.shapes.appearance.write import appearance_files
from kpred.shapes.mesh_output import check_mesh, write_mesh


def surface_writers(export: Export, path: Path) -> dict[Path, Writer]:
    """Return the mesh and, of an OBJ, its materials and textures: `x.mtl` and `x_*` beside `x.obj`.

    Raises:
        OutputError: the format cannot hold the mesh.
    """
    import trimesh

    (furniture,) = export.objects
    # Double precision: a `Mesh` has float32, which is too coarse far from the origin.
    mesh = trimesh.Trimesh(furniture.vertices, furniture.faces, process=False)
    check_mesh(path, mesh)
    if furniture.appearance is None or path.suffix.lower() != ".obj":
        return {path: lambda file: write_mesh(file, mesh, furniture.credit)}
    name = f"{path.stem}.obj"
    files = appearance_files(furniture.appearance, furniture.source, furniture.vertices, name, furniture.credit)
    writers: dict[Path, Writer] = {path: bytes_writer(files.pop(name))}
    return writers | {path.with_name(beside): bytes_writer(content) for beside, content in files.items()}
