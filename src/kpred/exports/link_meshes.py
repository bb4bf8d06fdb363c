"""Meshes beside a URDF or SDF file: the surface that is seen, and convex hulls that collide."""

from __future__ import annotations

from dataclasses import dataclass

from kpred.exports.bodies import Body
from kpred.exports.furniture import Export, Furniture
from kpred.exports.surfaces import obj_files, surfaces_of
from kpred.shapes.formats.obj import obj_lines


@dataclass(frozen=True, eq=False)
class LinkMeshes:
    """Files of one link, in its own frame.

    Attributes:
        visual: name of the OBJ that is seen; colliders: of the hull of each collider, None for boxes.
        files: content by name, materials and textures included.
    """

    visual: str
    colliders: tuple[str | None, ...]
    files: dict[str, bytes]


def link_meshes(export: Export, furniture: Furniture, body: Body, stem: str) -> LinkMeshes:
    """Write the meshes of an object as OBJ files `STEM_visual.obj` and `STEM_hull_N.obj`."""
    files = obj_files(surfaces_of(furniture, export.scan_to_body(furniture)), f"{stem}_visual")
    names: list[str | None] = []
    for number, collider in enumerate(body.colliders):
        if collider.hull is None:
            names.append(None)
            continue
        name = f"{stem}_hull_{number}.obj"
        files[name] = "".join(obj_lines(*collider.hull, None, 9)).encode()
        names.append(name)
    return LinkMeshes(f"{stem}_visual.obj", tuple(names), files)
