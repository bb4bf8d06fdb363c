"""A glTF file as a template: nodes, materials, textures and all attributes but positions, each mesh at one node."""

from __future__ import annotations

import base64
import copy
import json
from collections import Counter
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from kpred.errors import MeshError
from kpred.shapes.appearance.companions import find_companion
from kpred.shapes.appearance.gltf_buffer import GltfBuffer
from kpred.shapes.formats.gltf import instance_transforms, scene_roots, walk_node_numbers
from kpred.shapes.formats.gltf_accessor import read_accessor, read_stored_accessor
from kpred.shapes.formats.gltf_file import GltfFile, read_gltf_file
from kpred.shapes.formats.gltf_skin import skin_vertices

COUNT = "kpred_vertices"
"""Key of a primitive of a template: how many positions it lacks."""

_DRACO = "KHR_draco_mesh_compression"
_INSTANCING = "EXT_mesh_gpu_instancing"
_DECODED = (_DRACO, _INSTANCING, "EXT_meshopt_compression", "KHR_meshopt_compression")
_KEPT = ("asset", "materials", "textures", "samplers", "images", "cameras", "extensions", "extras")
_WHITE = base64.b64decode(
    "iVBORw0KGgoAAAANSUhEUgAAAAEAAAABCAIAAACQd1PeAAAADElEQVR4nGP4//8/AAX+Av4N70a4AAAAAElFTkSuQmCC"
)
"""One pixel, in place of a texture that is missing."""


class GltfTemplate(NamedTuple):
    """A glTF file without its positions, and the positions.

    Attributes:
        files: by name (`model.gltf`, `model.bin`).
        positions: (n, 3) of all vertices, in the world of the file.
        rows: (n,) the row of each among the vertices that `read_gltf` reads, -1 for those that it leaves out.
    """

    files: dict[str, bytes]
    positions: np.ndarray
    rows: np.ndarray


def read_gltf_template(path: Path) -> GltfTemplate:
    """Read a glTF file without its positions, animations, skins and morph targets.

    Raises:
        MeshError: damaged, or a node flattens its mesh, so that new positions cannot be expressed in it.
    """
    builder = _Template(read_gltf_file(path))
    builder.build()
    binary = bytes(builder.buffer.data)
    files = {"model.gltf": json.dumps(builder.content, separators=(",", ":")).encode(), "model.bin": binary}
    return GltfTemplate(
        files,
        np.concatenate([np.zeros((0, 3)), *builder.positions]),
        np.concatenate([[], *builder.rows]).astype(int),
    )


class _Template:
    """A template in the making."""

    def __init__(self, file: GltfFile) -> None:
        self.file = file
        self.buffer = GltfBuffer()
        self.worlds: dict[int, np.ndarray] = {}
        self.skin: Any = None
        source = copy.deepcopy(file.content)
        self.content: dict[str, Any] = {key: source[key] for key in _KEPT if key in source}
        for key in ("extensionsUsed", "extensionsRequired"):
            names = [name for name in source.get(key, []) if name not in _DECODED]
            self.content |= {key: names} if names else {}
        self.nodes: list[dict[str, Any]] = source.get("nodes", [])
        self.meshes: list[dict[str, Any]] = []
        self.positions: list[np.ndarray] = []
        self.rows: list[np.ndarray] = []
        self.read = 0
        self.users = Counter(
            primitive.get("attributes", {}).get("POSITION")
            for mesh in source.get("meshes", [])
            for primitive in mesh.get("primitives", [])
        )

    def build(self) -> None:
        """Go through all nodes in the order in which `read_gltf` does."""
        self.worlds = dict(walk_node_numbers(self.file))
        for number, world in self.worlds.items():
            node = self.nodes[number]
            self.skin = node.pop("skin", None)
            node.pop("weights", None)
            if "mesh" not in node:
                continue
            entry = self.file.item("meshes", node["mesh"])
            transforms = list(instance_transforms(self.file, node))
            if _INSTANCING not in node.get("extensions", {}):
                node["mesh"] = self._mesh(entry, node, world)
                continue
            del node["mesh"], node["extensions"][_INSTANCING]
            children = []
            for place, local in enumerate(transforms):
                mesh = self._mesh(entry, node, world @ local)
                name = f"{node.get('name', 'node')}_{place}"
                self.nodes.append({"name": name, "mesh": mesh, "matrix": local.T.reshape(-1).tolist()})
                children.append(len(self.nodes) - 1)
            node["children"] = children + node.get("children", [])
        self._images()
        self.content |= {"nodes": self.nodes, "meshes": self.meshes, "scene": 0}
        self.content["scenes"] = [{"nodes": scene_roots(self.file)}]
        self.content |= {"accessors": self.buffer.accessors, "bufferViews": self.buffer.views}
        self.content["buffers"] = [{"byteLength": len(self.buffer.data), "uri": "model.bin"}]

    def _mesh(self, entry: dict[str, Any], node: dict[str, Any], world: np.ndarray) -> int:
        scale = np.abs(world[:3, :3]).max()
        if not abs(np.linalg.det(world[:3, :3] / max(scale, 1e-300))) > 1e-9:
            raise MeshError(
                f"{self.file.path}: one of its nodes flattens its mesh; apply the scale and export it again."
            )
        primitives = [self._primitive(one, world) for one in entry.get("primitives", [])]
        mesh = {key: value for key, value in entry.items() if key in ("name", "extras")}
        self.meshes.append(mesh | {"primitives": [one for one in primitives if one is not None]})
        return len(self.meshes) - 1

    def _primitive(self, entry: dict[str, Any], world: np.ndarray) -> dict[str, Any] | None:
        attributes, indices = self._arrays(entry)
        if "POSITION" not in attributes:
            return None
        points = attributes.pop("POSITION")[0].astype(np.float64)
        if self.skin is not None and _DRACO not in entry.get("extensions", {}):
            points = skin_vertices(self.file, self.skin, entry["attributes"], points, self.worlds, world)
        else:
            points = points @ world[:3, :3].T + world[:3, 3]
        order = np.arange(len(points)) if indices is None else indices[:, 0].astype(np.int64)
        used, inverse = np.unique(order, return_inverse=True)
        rows = np.full(len(points), -1)
        if entry.get("mode", 4) not in (1, 2, 3):  # lines are not read
            is_thinned = len(points) > len(order)
            rows[used if is_thinned else slice(None)] = self.read + np.arange(len(used) if is_thinned else len(points))
            self.read += len(used) if is_thinned else len(points)
        if self.users[entry.get("attributes", {}).get("POSITION")] > 1 and indices is not None:
            points, rows = points[used], rows[used]
            attributes = {name: (array[used], flag) for name, (array, flag) in attributes.items()}
            indices = inverse.reshape(-1, 1).astype(np.uint32 if len(used) > 65535 else np.uint16)
        self.positions.append(points)
        self.rows.append(rows)
        kept = {key: value for key, value in entry.items() if key not in ("attributes", "indices", "targets")}
        if _DRACO in kept.get("extensions", {}):
            kept["extensions"] = {key: value for key, value in kept["extensions"].items() if key != _DRACO}
        kept["attributes"] = {
            name: self.buffer.add_array(array, normalized=flag) for name, (array, flag) in sorted(attributes.items())
        }
        if indices is not None:
            kept["indices"] = self.buffer.add_array(indices)
        return kept | {COUNT: len(points)}

    def _arrays(self, entry: dict[str, Any]) -> tuple[dict[str, tuple[np.ndarray, bool]], np.ndarray | None]:
        """Read attributes with whether they are normalised, and indices; directions and positions as floats."""
        named = entry.get("attributes", {})
        draco = entry.get("extensions", {}).get(_DRACO)
        if draco is not None:
            return _decoded(self.file, draco)
        found: dict[str, tuple[np.ndarray, bool]] = {}
        for name, number in named.items():
            if name in ("POSITION", "NORMAL", "TANGENT"):
                found[name] = (read_accessor(self.file, number).astype(np.float32), False)
            elif not name.startswith(("JOINTS", "WEIGHTS")):
                flag = self.file.item("accessors", number).get("normalized") is True
                found[name] = (read_stored_accessor(self.file, number), flag)
        count = len(found["POSITION"][0]) if "POSITION" in found else 0
        found = {name: (array, flag) for name, (array, flag) in found.items() if len(array) == count}
        indices = entry.get("indices")
        return found, None if indices is None else read_stored_accessor(self.file, indices)

    def _images(self) -> None:
        """Put all images into the buffer."""
        for number, image in enumerate(self.content.get("images", [])):
            uri = image.pop("uri", None)
            if "bufferView" in image:
                data = self.file.view(image["bufferView"])[0]
            elif isinstance(uri, str) and uri.startswith("data:"):
                data = base64.b64decode(uri.partition(",")[2])
            else:
                named = find_companion(self.file.path, [uri]) if isinstance(uri, str) else None
                data = _WHITE if named is None else named[1]
                image.setdefault("name", Path(uri).stem if isinstance(uri, str) else f"image_{number}")
            image["mimeType"] = _mime(data, image.get("mimeType"))
            image["bufferView"] = self.buffer.add_bytes(data)


def _decoded(file: GltfFile, draco: dict[str, Any]) -> tuple[dict[str, tuple[np.ndarray, bool]], np.ndarray | None]:
    """Decode attributes and indices of a primitive compressed by Draco."""
    import DracoPy

    decoded = DracoPy.decode(file.view(draco.get("bufferView"))[0])
    found: dict[str, tuple[np.ndarray, bool]] = {}
    count = len(np.asarray(decoded.points).reshape(-1, 3))
    for name, number in draco.get("attributes", {}).items():
        if name.startswith(("JOINTS", "WEIGHTS")):
            continue
        attribute = decoded.get_attribute_by_unique_id(int(number))
        values = np.asarray(attribute["data"]).reshape(count, -1)
        is_whole = values.dtype.kind in "iu"
        found[name] = (values if is_whole else values.astype(np.float32), is_whole and values.dtype.itemsize < 4)
    faces = getattr(decoded, "faces", None)
    return found, None if faces is None else np.asarray(faces, dtype=np.uint32).reshape(-1, 1)


def _mime(data: bytes, given: Any) -> str:
    for start, kind in ((b"\x89PNG", "png"), (b"\xff\xd8", "jpeg"), (b"RIFF", "webp"), (b"\xabKTX", "ktx2")):
        if data.startswith(start):
            return f"image/{kind}"
    return str(given or "image/png")
