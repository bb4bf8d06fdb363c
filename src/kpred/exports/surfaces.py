"""Surfaces of furniture by material, for formats that have materials of their own."""

from __future__ import annotations

import io
from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import trimesh

from kpred.exports.furniture import Furniture, moved
from kpred.ops.typing import Float, Int
from kpred.shapes.appearance.write import appearance_files

GREY = (0.7, 0.7, 0.7, 1.0)
"""Colour of models without materials, linear RGBA."""


@dataclass(frozen=True, eq=False)
class Material:
    """A material of the metallic-roughness model.

    Attributes:
        name: of it; color: RGBA in [0, 1]; texture: a PNG that multiplies the colour, or None.
    """

    name: str
    color: tuple[float, ...] = GREY
    metallic: float = 0.0
    roughness: float = 0.8
    texture: bytes | None = None


@dataclass(frozen=True, eq=False)
class Surface:
    """Triangles of one material: vertices (n, 3), faces (m, 3), UV coordinates (n, 2) or None."""

    name: str
    vertices: Float[np.ndarray, "n 3"]
    faces: Int[np.ndarray, "m 3"]
    uv: Float[np.ndarray, "n 2"] | None
    material: Material


def surfaces_of(furniture: Furniture, matrix: Float[np.ndarray, "4 4"]) -> list[Surface]:
    """List the surfaces of an object, in the frame that the matrix takes the scan's frame to."""
    if furniture.appearance is None:
        vertices, faces = moved(matrix, furniture.vertices), np.asarray(furniture.faces, dtype=np.int64)
        return [Surface("surface", vertices, faces, None, Material("grey"))]
    # Positions are brought close to the origin first: glTF has float32 only.
    middle = furniture.vertices.mean(axis=0)
    near = furniture.vertices - middle
    back = np.eye(4)
    back[:3, 3] = middle
    files = appearance_files(furniture.appearance, furniture.source, near, "a.glb", furniture.credit)
    scene = trimesh.load_scene(io.BytesIO(files["a.glb"]), file_type="glb", process=False)
    found = [replace(one, vertices=moved(matrix @ back, one.vertices)) for one in _of_scene(scene)]
    return [replace(one, name=f"{number:03d}_{one.name}") for number, one in enumerate(found)]


def obj_files(surfaces: list[Surface], name: str) -> dict[str, bytes]:
    """Write surfaces as an OBJ, its MTL and its textures: content by file name, `name`.obj first."""
    lines, materials, files, start = [f"mtllib {name}.mtl"], [], {}, 1
    textures: dict[str, bytes] = {}
    for number, one in enumerate(surfaces):
        label = f"material_{number}"
        lines += [f"o {_word(one.name)}", f"usemtl {label}"]
        lines += [f"v {x:.9g} {y:.9g} {z:.9g}" for x, y, z in one.vertices]
        uv = np.zeros((len(one.vertices), 2)) if one.uv is None else one.uv
        lines += [f"vt {u:.7g} {v:.7g}" for u, v in uv]
        lines += ["f " + " ".join(f"{corner}/{corner}" for corner in row) for row in (one.faces + start).tolist()]
        start += len(one.vertices)
        red, green, blue, alpha = one.material.color
        materials += [f"newmtl {label}", f"Kd {red:.4g} {green:.4g} {blue:.4g}", f"d {alpha:.4g}"]
        if one.material.texture is not None and one.uv is not None:
            file = f"{name}_{number}.png"
            textures[file] = one.material.texture
            materials.append(f"map_Kd {file}")
    files[f"{name}.obj"] = ("\n".join(lines) + "\n").encode()
    files[f"{name}.mtl"] = ("\n".join(materials) + "\n").encode()
    return files | textures


def _of_scene(scene: trimesh.Scene) -> Iterator[Surface]:
    for node in scene.graph.nodes_geometry:
        matrix, name = scene.graph[node]
        mesh = scene.geometry[name]
        if not isinstance(mesh, trimesh.Trimesh) or not len(mesh.faces):
            continue
        faces = np.asarray(mesh.faces, dtype=np.int64)
        if np.linalg.det(matrix[:3, :3]) < 0:
            faces = faces[:, ::-1]
        uv = getattr(mesh.visual, "uv", None)
        has_uv = uv is not None and len(uv) == len(mesh.vertices)
        vertices = moved(np.asarray(matrix, dtype=np.float64), np.asarray(mesh.vertices))
        yield Surface(
            str(node), vertices, faces, np.asarray(uv, dtype=np.float64) if has_uv else None, _material(mesh.visual)
        )


def _material(visual: Any) -> Material:
    found = getattr(visual, "material", None)
    if not isinstance(found, trimesh.visual.material.PBRMaterial):
        return Material("grey")
    factor = np.asarray(found.baseColorFactor if found.baseColorFactor is not None else [255] * 4, dtype=np.float64)
    color = factor / 255 if factor.max() > 1 else factor
    texture = None
    if found.baseColorTexture is not None:
        stream = io.BytesIO()
        found.baseColorTexture.convert("RGBA").save(stream, format="PNG")
        texture = stream.getvalue()
    return Material(
        str(found.name or "material"),
        tuple(float(value) for value in np.append(color, 1.0)[:4]),
        1.0 if found.metallicFactor is None else float(found.metallicFactor),
        1.0 if found.roughnessFactor is None else float(found.roughnessFactor),
        texture,
    )


def _word(name: str) -> str:
    return "".join(letter if letter.isalnum() or letter in "_-." else "_" for letter in name) or "surface"
