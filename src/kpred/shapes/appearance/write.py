"""A deformed mesh with the appearance of its source, as the files of an OBJ or a GLB."""

from __future__ import annotations

import io
from collections.abc import Mapping

import numpy as np
import trimesh

from kpred.ops.typing import Float
from kpred.shapes.appearance.appearance import Appearance
from kpred.shapes.appearance.gltf_fill import write_gltf_template
from kpred.shapes.appearance.obj_template import strip_map_options, write_obj_template
from kpred.shapes.credit import Credit
from kpred.shapes.precision import needs_double

EXTENSIONS = (".obj", ".glb")
"""Formats that hold an appearance."""


def appearance_files(
    appearance: Appearance,
    source: Float[np.ndarray, "vertices 3"],
    result: Float[np.ndarray, "vertices 3"],
    name: str,
    credit: Credit,
) -> dict[str, bytes]:
    """Write the file that a mesh came from with new positions; the file itself first, then what lies beside it.

    From OBJ to GLB, or back, materials and names go as far as `trimesh` carries them.

    Args:
        source: vertices of the mesh as it was; result: as it is now.
        name: of the file, ending in .obj or .glb.
    """
    stem, _, extension = name.rpartition(".")
    old = appearance.positions(source, source)
    new = appearance.positions(source, result)
    digits = 17 if needs_double(new, 1e-6) else 9
    if appearance.kind == "obj":
        files = write_obj_template(appearance.files, old, new, appearance.rotation, stem, digits, credit.lines())
        return files if extension == "obj" else {name: _glb_of_obj(files, f"{stem}.obj", credit)}
    data = write_gltf_template(appearance.files, old, new, appearance.rotation, credit.asset())
    return {name: data} if extension == "glb" else _obj_of_glb(data, stem, credit)


def _glb_of_obj(files: Mapping[str, bytes], name: str, credit: Credit) -> bytes:
    """Convert by trimesh, which knows no options of textures, and drops the names of materials."""
    plain = {key: strip_map_options(value) if key.endswith(".mtl") else value for key, value in files.items()}
    loaded = trimesh.load_scene(
        io.BytesIO(files[name]), file_type="obj", resolver=plain, split_objects=True, process=False
    )
    scene = trimesh.Scene()
    for key, mesh in loaded.geometry.items():
        material = getattr(mesh.visual, "material", None)
        label = str(getattr(material, "name", "") or "")
        if isinstance(material, trimesh.visual.material.SimpleMaterial):
            mesh.visual.material = material.to_pbr()
            mesh.visual.material.name = label
            # Materials of MTL are no metals, and seen from both sides; glTF's defaults are the other way.
            mesh.visual.material.metallicFactor = 0.0
            mesh.visual.material.doubleSided = True
        node = key.removesuffix(f"_{label}")
        node = key if node in scene.geometry else node
        scene.add_geometry(mesh, node_name=node, geom_name=node)
    return bytes(scene.export(file_type="glb", tree_postprocessor=lambda tree: tree["asset"].update(credit.asset())))


def _obj_of_glb(data: bytes, stem: str, credit: Credit) -> dict[str, bytes]:
    scene = trimesh.load_scene(io.BytesIO(data), file_type="glb", process=False)
    text, beside = trimesh.exchange.obj.export_obj(
        scene,
        return_texture=True,
        write_texture=False,
        mtl_name=f"{stem}.mtl",
        include_normals=True,
        digits=9,
        header="\n".join(credit.lines()),
    )
    materials = bytes(beside.pop(f"{stem}.mtl", b"")).decode()
    for texture in beside:
        materials = materials.replace(f" {texture}\n", f" {stem}_{texture}\n")
    textures = {f"{stem}_{texture}": bytes(content) for texture, content in beside.items()}
    found = {f"{stem}.obj": text.encode()} | textures
    return found | ({f"{stem}.mtl": materials.encode()} if materials else {})
