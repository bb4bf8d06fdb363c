"""Joining the glTF files of several objects into one, materials and textures included."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from kpred.shapes.appearance.gltf_buffer import GltfBuffer

_LISTS = (
    *("accessors", "bufferViews", "cameras", "images", "materials"),
    *("meshes", "nodes", "samplers", "skins", "textures"),
)

_INDEX = {
    **{"bufferView": "bufferViews", "mesh": "meshes", "skin": "skins", "camera": "cameras", "material": "materials"},
    **{"indices": "accessors", "inverseBindMatrices": "accessors", "source": "images", "sampler": "samplers"},
    **{"index": "textures", "skeleton": "nodes"},
}
"""Keys whose value is the number of an entry of a list."""

_INDICES = {"children": "nodes", "joints": "nodes"}
"""Keys whose value is a list of such numbers."""


@dataclass(frozen=True, eq=False)
class Part:
    """A glTF file: its JSON, and its one buffer."""

    content: dict[str, Any]
    data: bytes


def join_parts(parts: Sequence[Part]) -> tuple[dict[str, Any], GltfBuffer]:
    """Join files into one JSON without scenes, and its buffer; `roots` lists the root nodes of each file."""
    joined: dict[str, Any] = {name: [] for name in _LISTS}
    joined["roots"] = []
    data = bytearray()
    for part in parts:
        data += bytes(-len(data) % 4)
        starts = {name: len(joined[name]) for name in _LISTS}
        for name in _LISTS:
            for entry in part.content.get(name, []):
                moved = _renumbered(entry, starts)
                if name == "bufferViews":
                    moved["byteOffset"] = moved.get("byteOffset", 0) + len(data)
                joined[name].append(moved)
        roots = part.content["scenes"][part.content.get("scene", 0)].get("nodes", [])
        joined["roots"].append([node + starts["nodes"] for node in roots])
        for name in ("extensionsUsed", "extensionsRequired"):
            if part.content.get(name):
                joined[name] = sorted({*joined.get(name, []), *part.content[name]})
        data += part.data
    rest = {} if len(parts) > 1 else {key: value for key, value in parts[0].content.items() if key not in joined}
    buffer = GltfBuffer(bytes(data), {name: joined.pop(name) for name in ("accessors", "bufferViews")})
    return {**rest, **joined}, buffer


def _renumbered(value: Any, starts: dict[str, int]) -> Any:
    """Add the starts of the lists to all numbers of entries in a value."""
    if isinstance(value, list):
        return [_renumbered(item, starts) for item in value]
    if not isinstance(value, dict):
        return value
    found: dict[str, Any] = {}
    for key, item in value.items():
        if key == "extras":
            found[key] = item
        elif key == "attributes" or (key == "targets" and isinstance(item, list)):
            found[key] = _accessors(item, starts["accessors"])
        elif key in _INDEX and isinstance(item, int):
            found[key] = item + starts[_INDEX[key]]
        elif key in _INDICES:
            found[key] = [number + starts[_INDICES[key]] for number in item]
        else:
            found[key] = _renumbered(item, starts)
    return found


def _accessors(value: Any, start: int) -> Any:
    if isinstance(value, list):
        return [_accessors(item, start) for item in value]
    return {name: number + start for name, number in value.items()}
