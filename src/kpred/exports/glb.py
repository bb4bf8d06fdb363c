"""GLB as viewers want it: metres, y up; the node `scan` is the scan's own frame and unit."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np

from kpred.exports.furniture import Export, Furniture
from kpred.exports.glb_join import Part, join_parts
from kpred.exports.surfaces import GREY
from kpred.exports.writer import Writer, bytes_writer
from kpred.shapes.appearance.gltf_buffer import GltfBuffer
from kpred.shapes.appearance.write import appearance_files
from kpred.shapes.precision import needs_double

SCAN_NODE = "scan"
"""Node below which everything is in the scan's own frame and unit; its matrix leads to metres, y up."""

_TOLERANCE = 1e-4


def glb_writers(export: Export, path: Path) -> dict[Path, Writer]:
    """Return the one file: `scan`, below it a node for each object, below that the nodes of its model.

    Model id, category, confidence, author and licence are the `extras` of each object's node, and of the asset where
    there is one object.
    """
    content, buffer = join_parts([_part(one) for one in export.objects])
    nodes: list[dict[str, Any]] = content["nodes"]
    tops = []
    for furniture, roots in zip(export.objects, content.pop("roots"), strict=True):
        entries = furniture.credit.asset()["extras"]
        nodes.append({"name": furniture.name, "children": roots, "extras": entries})
        tops.append(len(nodes) - 1)
    root: dict[str, Any] = {"name": SCAN_NODE, "children": tops}
    if not np.array_equal(export.scan_to_y_up, np.eye(4)):
        root["matrix"] = export.scan_to_y_up.T.ravel().tolist()
    nodes.append(root)
    content["scenes"], content["scene"] = [{"nodes": [len(nodes) - 1]}], 0
    asset = export.objects[0].credit.asset()
    if len(export.objects) > 1:
        owners = [one.credit.asset().get("copyright") for one in export.objects]
        asset = {"generator": asset["generator"]}
        if any(owners):
            asset["copyright"] = "; ".join(dict.fromkeys(owner for owner in owners if owner))
    content["asset"] = {**content.get("asset", {}), "version": "2.0", **asset}
    return {path: bytes_writer(buffer.glb(content))}


def _part(furniture: Furniture) -> Part:
    """Make the glTF of one object in the scan's frame: its model's own file, or one plain mesh."""
    if furniture.appearance is not None:
        files = appearance_files(furniture.appearance, furniture.source, furniture.vertices, "a.glb", furniture.credit)
        return split_glb(files["a.glb"])
    vertices = np.asarray(furniture.vertices, dtype=np.float64)
    node: dict[str, Any] = {"name": "mesh", "mesh": 0}
    if needs_double(vertices, _TOLERANCE):
        middle = np.round((vertices.min(axis=0) + vertices.max(axis=0)) / 2)
        vertices, node["translation"] = vertices - middle, middle.tolist()
    buffer = GltfBuffer()
    primitive = {
        "attributes": {"POSITION": buffer.add_array(vertices.astype(np.float32), with_bounds=True)},
        "indices": buffer.add_array(np.asarray(furniture.faces, dtype=np.uint32).reshape(-1, 1)),
        "material": 0,
    }
    color = {"baseColorFactor": list(GREY), "metallicFactor": 0.0, "roughnessFactor": 0.8}
    content = {
        "scenes": [{"nodes": [0]}],
        "nodes": [node],
        "meshes": [{"name": "mesh", "primitives": [primitive]}],
        # Faces of CAD models need not look outward.
        "materials": [{"name": "grey", "pbrMetallicRoughness": color, "doubleSided": True}],
        "accessors": buffer.accessors,
        "bufferViews": buffer.views,
    }
    return Part(content, bytes(buffer.data))


def split_glb(data: bytes) -> Part:
    """Split a .glb that kpred wrote into its JSON and its buffer."""
    length = int.from_bytes(data[12:16], "little")
    content = json.loads(data[20 : 20 + length])
    binary = data[28 + length :] if len(data) > 20 + length else b""
    return Part(content, binary)
