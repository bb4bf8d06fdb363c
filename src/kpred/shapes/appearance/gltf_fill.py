"""Filling a glTF template with positions: a .glb whose nodes, names, materials and attributes are those of the file."""

from __future__ import annotations

import copy
import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from kpred.shapes.appearance.gltf_buffer import GltfBuffer
from kpred.shapes.appearance.gltf_template import COUNT
from kpred.shapes.appearance.normals import deform_directions, triangle_corners
from kpred.shapes.formats.gltf import triangles_of, walk_node_numbers
from kpred.shapes.formats.gltf_accessor import read_accessor
from kpred.shapes.formats.gltf_file import GltfFile
from kpred.shapes.precision import needs_double

_ROOT = "scan"
_TOLERANCE = 1e-4


def write_gltf_template(
    files: Mapping[str, bytes],
    source: np.ndarray,
    result: np.ndarray,
    rotation: np.ndarray,
    asset: Mapping[str, Any] | None = None,
) -> bytes:
    """Fill in positions (n, 3) and carry normals and tangents along; return a .glb.

    Far from the origin all hangs below one more node, `scan`, so that float32 is enough.

    Args:
        source: positions that the file had, in the axes of the mesh; rotation: from the file's axes to those.
        asset: entries of `asset`, such as `copyright` and `extras`.
    """
    content = json.loads(files["model.gltf"])
    file = GltfFile(Path("model.gltf"), copy.deepcopy(content), files["model.bin"])
    del file.content["buffers"][0]["uri"]
    buffer = GltfBuffer(files["model.bin"], content)
    middle = np.zeros(3)
    if needs_double(result, _TOLERANCE):
        middle = np.round((result.min(axis=0) + result.max(axis=0)) / 2)
    start = 0
    for number, world in walk_node_numbers(file):
        node = content["nodes"][number]
        for primitive in content["meshes"][node["mesh"]]["primitives"] if "mesh" in node else []:
            rows = slice(start, start + primitive.pop(COUNT))
            start = rows.stop
            _fill(file, buffer, primitive, world, (source[rows], result[rows] - middle), rotation)
    if middle.any():
        roots = content["scenes"][0]["nodes"]
        content["nodes"].append({"name": _ROOT, "translation": middle.tolist(), "children": roots})
        content["scenes"][0]["nodes"] = [len(content["nodes"]) - 1]
    content["asset"] = {**content.get("asset", {}), "version": "2.0", **(asset or {})}
    return buffer.glb(content)


def _fill(
    file: GltfFile,
    buffer: GltfBuffer,
    primitive: dict[str, Any],
    world: np.ndarray,
    points: tuple[np.ndarray, np.ndarray],
    rotation: np.ndarray,
) -> None:
    source, result = points
    linear, place = world[:3, :3], world[:3, 3]
    inverse = np.linalg.inv(linear)
    attributes = primitive["attributes"]
    directions = {name: read_accessor(file, attributes[name]) for name in ("NORMAL", "TANGENT") if name in attributes}
    attributes["POSITION"] = buffer.add_array(((result - place) @ inverse.T).astype(np.float32), with_bounds=True)
    if not directions or primitive.get("mode", 4) < 4:
        return
    indices = np.arange(len(source))
    if "indices" in primitive:
        indices = read_accessor(file, primitive["indices"])[:, 0].astype(np.int64)
    faces = triangles_of(file, indices, primitive.get("mode", 4))
    # A node that mirrors turns the faces inside out, before and after.
    corners = triangle_corners(faces)
    for name, values in directions.items():
        is_normal = name == "NORMAL"
        old = values[:, :3].astype(np.float64) @ (inverse if is_normal else linear.T) @ rotation.T
        new = deform_directions(corners, source, result, old, is_normal) @ (linear if is_normal else inverse.T)
        length = np.linalg.norm(new, axis=1, keepdims=True)
        new = new / np.where(length > 0, length, 1.0)
        buffer.replace_array(attributes[name], np.concatenate([new, values[:, 3:]], axis=1).astype(np.float32))
