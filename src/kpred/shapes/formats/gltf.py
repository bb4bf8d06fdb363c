"""Positions, faces and parts of glTF 2.0 files: nodes with their transforms, instances and compressed meshes."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from kpred.errors import MeshError
from kpred.shapes.formats.geometry import Geometry
from kpred.shapes.formats.gltf_accessor import read_accessor
from kpred.shapes.formats.gltf_file import GltfFile, read_gltf_file
from kpred.shapes.formats.gltf_skin import skin_vertices
from kpred.shapes.formats.ply_mesh import strip_triangles

_INSTANCING = "EXT_mesh_gpu_instancing"
_DRACO = "KHR_draco_mesh_compression"
_MAX_PLACED = 10_000_000
"""Vertices and faces that instances may make beyond those of the file."""

_MAX_INSTANCES = 100_000

_Primitive = tuple[np.ndarray, np.ndarray]
"""(V, 3) float64 vertices and (F, 3) int64 faces in the frame of the mesh."""


def read_gltf(path: Path) -> Geometry:
    """Read vertices, faces and parts of the file's own scene.

    A part is one primitive at one node. Triangles, strips, fans and points are read; lines are left out. Morph targets
    have their default weights, and skins the pose of the file's nodes.

    Raises:
        MeshError: damaged, cut short, or an extension that is not supported is required.
    """
    file = read_gltf_file(path)
    meshes: dict[tuple[int, int | None], list[_Primitive]] = {}
    positions: dict[int, np.ndarray] = {}
    vertices, faces, parts = [np.zeros((0, 3))], [np.zeros((0, 3), np.int64)], [np.zeros(0, np.int64)]
    count = number = stored = placed = 0
    worlds = dict(walk_node_numbers(file))
    for place, world in worlds.items():
        node = file.item("nodes", place)
        if "mesh" not in node:
            continue
        entry = file.item("meshes", node["mesh"])
        is_skinned = node.get("skin") is not None
        mesh = node["mesh"], place if is_skinned else None
        if mesh not in meshes:
            meshes[mesh] = list(_primitives(file, entry, place, positions, worlds))
            stored += 0 if is_skinned else sum(len(points) + len(triangles) for points, triangles in meshes[mesh])
        for local in instance_transforms(file, node):
            matrix = np.eye(4) if is_skinned else world @ local
            for points, triangles in meshes[mesh]:
                placed += len(points) + len(triangles)
                if placed > stored + _MAX_PLACED:
                    raise MeshError(f"{path}: its instances have too many vertices; export fewer of them.")
                vertices.append(points @ matrix[:3, :3].T + matrix[:3, 3])
                # A mirrored part keeps its outside outside.
                faces.append((triangles[:, ::-1] if np.linalg.det(matrix[:3, :3]) < 0 else triangles) + count)
                parts.append(np.full(len(triangles), number, dtype=np.int64))
                count += len(points)
                number += 1
    return Geometry(np.concatenate(vertices), np.concatenate(faces), np.concatenate(parts))


def walk_nodes(file: GltfFile) -> Iterator[tuple[dict[str, Any], np.ndarray]]:
    """Yield nodes of the default scene with their (4, 4) transforms to the world; without scenes, of all roots."""
    for number, world in walk_node_numbers(file):
        yield file.item("nodes", number), world


def scene_roots(file: GltfFile) -> list[int]:
    """List the root nodes of the default scene, or all nodes without a parent where there are no scenes."""
    entries = file.content.get("nodes")
    total = len(entries) if isinstance(entries, list) else 0
    scenes = file.content.get("scenes")
    if isinstance(scenes, list) and scenes:
        return _list(file.item("scenes", file.content.get("scene", 0)).get("nodes", []))
    children = {child for number in range(total) for child in _list(file.item("nodes", number).get("children"))}
    return [number for number in range(total) if number not in children]


def walk_node_numbers(file: GltfFile) -> Iterator[tuple[int, np.ndarray]]:
    """Yield numbers of nodes and their (4, 4) transforms to the world, in the order in which meshes are read.

    Nodes are those of the default scene; without scenes, all.
    """
    waiting = [(number, np.eye(4)) for number in reversed(scene_roots(file))]
    seen: set[int] = set()
    while waiting:
        number, parent = waiting.pop()
        if number in seen:
            raise MeshError(f"{file.path}: one of its nodes has two parents; export it again.")
        node = file.item("nodes", number)
        seen.add(number)
        world = parent @ _transform(file, node)
        yield number, world
        waiting += [(child, world) for child in reversed(_list(node.get("children")))]


def _list(value: Any) -> list[Any]:
    return [item for item in value if isinstance(item, int)] if isinstance(value, list) else []


def _transform(file: GltfFile, node: dict[str, Any]) -> np.ndarray:
    """Return the (4, 4) matrix of a node, for column vectors."""
    try:
        if "matrix" in node:
            matrix = np.array(node["matrix"], dtype=np.float64).reshape(4, 4).T
        else:
            translation, rotation, scale = (
                np.array(node.get(key, default), dtype=np.float64).reshape(len(default))
                for key, default in (("translation", [0, 0, 0]), ("rotation", [0, 0, 0, 1]), ("scale", [1, 1, 1]))
            )
            matrix = compose_transform(translation, rotation, scale)
        if not np.isfinite(matrix).all():
            raise ValueError("not finite")
    except (TypeError, ValueError, OverflowError) as error:
        raise MeshError(f"{file.path}: one of its nodes has a broken transform; export it again.") from error
    return matrix


def compose_transform(translation: np.ndarray, rotation: np.ndarray, scale: np.ndarray) -> np.ndarray:
    """Compose a (4, 4) matrix, for column vectors, of a translation (3,), a quaternion (4,) and a scale (3,)."""
    from scipy.spatial.transform import Rotation

    matrix = np.eye(4)
    matrix[:3, :3] = Rotation.from_quat(rotation).as_matrix() * scale
    matrix[:3, 3] = translation
    return matrix


def instance_transforms(file: GltfFile, node: dict[str, Any]) -> Iterator[np.ndarray]:
    """Return the (4, 4) transforms of a node's mesh within the node, one per instance."""
    extensions = node.get("extensions")
    instancing = extensions.get(_INSTANCING) if isinstance(extensions, dict) else None
    attributes = instancing.get("attributes") if isinstance(instancing, dict) else None
    if not isinstance(attributes, dict) or not attributes:
        yield np.eye(4)
        return
    found = {
        key: read_accessor(file, attributes[key]).astype(np.float64)
        for key in ("TRANSLATION", "ROTATION", "SCALE")
        if key in attributes
    }
    count = len(next(iter(found.values()))) if found else 0
    if count > _MAX_INSTANCES:
        raise MeshError(f"{file.path}: its {count} instances are too many; export fewer of them.")
    widths = {"TRANSLATION": 3, "ROTATION": 4, "SCALE": 3}
    for key, values in found.items():
        if values.shape != (count, widths[key]) or not np.isfinite(values).all():
            raise MeshError(f"{file.path}: its instances ({_INSTANCING}) are damaged; export them as single meshes.")
    for row in range(count):
        yield compose_transform(
            found["TRANSLATION"][row] if "TRANSLATION" in found else np.zeros(3),
            found["ROTATION"][row] if "ROTATION" in found else np.array([0.0, 0.0, 0.0, 1.0]),
            found["SCALE"][row] if "SCALE" in found else np.ones(3),
        )


def _primitives(
    file: GltfFile,
    mesh: dict[str, Any],
    place: int,
    positions: dict[int, np.ndarray],
    worlds: dict[int, np.ndarray],
) -> Iterator[_Primitive]:
    """Read the mesh of the node at a place, in the world where it has a skin; `positions` caches shared accessors."""
    node, own = file.item("nodes", place), worlds[place]
    weights = node.get("weights", mesh.get("weights"))
    entries = mesh.get("primitives")
    for primitive in entries if isinstance(entries, list) else []:
        if not isinstance(primitive, dict):
            raise MeshError(f"{file.path}: one of its meshes is damaged; export it again.")
        mode = primitive.get("mode", 4)
        if mode in (1, 2, 3):  # Lines.
            continue
        extensions = primitive.get("extensions")
        if isinstance(extensions, dict) and isinstance(extensions.get(_DRACO), dict):
            vertices, triangles = _draco(file, extensions[_DRACO])
            # Of a compressed mesh the joints are not read; at rest they leave it where its node puts it.
            yield (vertices if node.get("skin") is None else vertices @ own[:3, :3].T + own[:3, 3]), triangles
            continue
        vertices = read_positions(file, primitive, weights if isinstance(weights, list) else [], positions)
        if node.get("skin") is not None:
            vertices = skin_vertices(file, node["skin"], primitive["attributes"], vertices, worlds, own)
        indices = np.arange(len(vertices))
        if primitive.get("indices") is not None:
            indices = read_accessor(file, primitive["indices"])[:, 0]
            if indices.dtype.kind == "f" or (len(indices) and indices.max() >= len(vertices)) or (indices < 0).any():
                raise MeshError(f"{file.path}: a face names a vertex that does not exist; export the mesh again.")
        if len(vertices) > len(indices):
            used, indices = np.unique(indices, return_inverse=True)
            vertices = vertices[used]
        yield vertices, triangles_of(file, indices.astype(np.int64), mode)


def read_positions(
    file: GltfFile, primitive: dict[str, Any], weights: list[Any], known: dict[int, np.ndarray]
) -> np.ndarray:
    """Read the positions (N, 3) of a primitive, its morph targets by their weights; `known` keeps accessors."""
    attributes = primitive.get("attributes")
    if not isinstance(attributes, dict) or "POSITION" not in attributes:
        raise MeshError(f"{file.path}: one of its meshes has no positions; export it again.")
    number = attributes["POSITION"]
    file.item("accessors", number)
    if number not in known:
        known[number] = read_accessor(file, number).astype(np.float64)
    vertices = known[number]
    targets = primitive.get("targets")
    for weight, target in zip(weights, targets if isinstance(targets, list) else [], strict=False):
        if isinstance(weight, int | float) and weight and isinstance(target, dict) and "POSITION" in target:
            moved = read_accessor(file, target["POSITION"])
            if moved.shape == vertices.shape:
                vertices = vertices + weight * moved
    if vertices.shape[1] != 3:
        raise MeshError(f"{file.path}: its positions do not have three coordinates; export it again.")
    return vertices


def triangles_of(file: GltfFile, indices: np.ndarray, mode: Any) -> np.ndarray:
    """Cut the indices of a primitive of this mode into triangles (F, 3); points have none."""
    if mode == 0:
        return np.zeros((0, 3), dtype=np.int64)
    if mode == 4:
        return indices[: len(indices) // 3 * 3].reshape(-1, 3)
    if mode == 5:
        return strip_triangles(np.append(indices, -1))
    if mode == 6:
        rest = max(len(indices) - 2, 0)
        return np.stack([np.repeat(indices[:1], rest), indices[1 : rest + 1], indices[2 : rest + 2]], axis=1)
    raise MeshError(f"{file.path}: one of its meshes is of the unknown mode {str(mode)[:20]}; export it as triangles.")


def _draco(file: GltfFile, extension: dict[str, Any]) -> _Primitive:
    data, _ = file.view(extension.get("bufferView"))
    try:
        import DracoPy

        decoded = DracoPy.decode(data)
        vertices = np.asarray(decoded.points, dtype=np.float64).reshape(-1, 3)
        faces = np.asarray(getattr(decoded, "faces", np.zeros((0, 3))), dtype=np.int64).reshape(-1, 3)
        if len(faces) and (faces.min() < 0 or faces.max() >= len(vertices)):
            raise ValueError("a face names a vertex that does not exist")
    except Exception as error:
        raise MeshError(f"{file.path}: its {_DRACO} data cannot be decoded; export it without compression.") from error
    return vertices, faces
