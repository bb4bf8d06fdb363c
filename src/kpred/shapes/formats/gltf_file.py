"""The container of glTF 2.0: its JSON, the buffers it refers to, and views of them, compressed ones decoded."""

from __future__ import annotations

import base64
import binascii
import json
import re
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any
from urllib.parse import unquote

import numpy as np

from kpred.errors import MeshError
from kpred.shapes.reading import check_file, leads_outside

_MAGIC = b"glTF"
_JSON, _BINARY = b"JSON", b"BIN\0"
_MESHOPT = ("EXT_meshopt_compression", "KHR_meshopt_compression")

_MAX_RATIO = 512
"""Bytes that meshopt makes of one at most, beyond a first million: it cannot compress better by much."""

_SUPPORTED = (
    *_MESHOPT,
    "KHR_draco_mesh_compression",
    "EXT_mesh_gpu_instancing",
    "KHR_mesh_quantization",
    "KHR_texture_transform",
    "KHR_texture_basisu",
    "KHR_lights_punctual",
    "KHR_animation_pointer",
    "KHR_xmp_json_ld",
    "KHR_node_visibility",
    "EXT_structural_metadata",
    "EXT_mesh_features",
    "EXT_instance_features",
    "CESIUM_primitive_outline",
    "FB_ngon_encoding",
)
"""Extensions that are read, or that say nothing about geometry; so do all that begin with one of the next."""

_APPEARANCE = ("KHR_materials_", "EXT_texture_", "MSFT_texture_", "MSFT_packing_", "EXT_lights_", "ADOBE_materials_")


@dataclass(frozen=True, eq=False)
class GltfFile:
    """A glTF file: `content` is its JSON; buffers are read when they are first needed."""

    path: Path
    content: dict[str, Any]
    binary: bytes | None
    _buffers: dict[int, bytes] = field(default_factory=dict)

    def item(self, kind: str, number: Any) -> dict[str, Any]:
        """Return entry `number` of one of the lists of the JSON, such as `accessors`.

        Raises:
            MeshError: there is none.
        """
        entries = self.content.get(kind)
        is_index = isinstance(number, int) and not isinstance(number, bool)
        if isinstance(entries, list) and is_index and 0 <= number < len(entries) and isinstance(entries[number], dict):
            found: dict[str, Any] = entries[number]
            return found
        raise MeshError(f"{self.path}: it refers to {kind} {str(number)[:20]}, which is not there; export it again.")

    def view(self, number: Any) -> tuple[bytes, int | None]:
        """Return the decoded bytes of a buffer view, and its stride if it has one.

        Raises:
            MeshError: it lies outside of its buffer, or cannot be decoded.
        """
        view = self.item("bufferViews", number)
        extensions = view.get("extensions") if isinstance(view.get("extensions"), dict) else {}
        for name in _MESHOPT:
            if name in (extensions or {}):
                packed = (extensions or {})[name]
                width = whole(packed, "byteStride", self.path)
                return self._decoded(packed, width, name), width
        stride = whole(view, "byteStride", self.path) if "byteStride" in view else None
        return self._slice(view), stride

    def _slice(self, view: dict[str, Any]) -> bytes:
        buffer = self._buffer(view.get("buffer"))
        start, length = whole(view, "byteOffset", self.path, 0), whole(view, "byteLength", self.path)
        if start + length > len(buffer):
            raise MeshError(f"{self.path}: its data ends before its meshes do (cut short?); copy it again.")
        return buffer[start : start + length]

    def _decoded(self, packed: dict[str, Any], stride: int, name: str) -> bytes:
        try:
            import meshoptimizer
        except ImportError as error:
            raise MeshError(
                f"{self.path}: it needs {name}; pip install meshoptimizer, or export it without compression."
            ) from error
        data, count = self._slice(packed), whole(packed, "count", self.path)
        if count * stride > (1 << 20) + _MAX_RATIO * len(data):
            raise MeshError(f"{self.path}: its {name} data is damaged; export it without compression.")
        mode, kind = str(packed.get("mode")), str(packed.get("filter", "NONE"))
        source = np.frombuffer(data, np.uint8)
        try:
            if mode == "ATTRIBUTES":
                decoded = np.ascontiguousarray(meshoptimizer.decode_vertex_buffer(count, stride, source))
                filters = {"OCTAHEDRAL": "oct", "QUATERNION": "quat", "EXPONENTIAL": "exp"}
                if kind in filters:
                    getattr(meshoptimizer, f"decode_filter_{filters[kind]}")(decoded, count, stride)
            elif mode == "TRIANGLES":
                decoded = meshoptimizer.decode_index_buffer(count, stride, source)
            else:
                decoded = meshoptimizer.decode_index_sequence(count, stride, source)
        except Exception as error:
            raise MeshError(
                f"{self.path}: its {name} data cannot be decoded; export it without compression."
            ) from error
        return np.ascontiguousarray(decoded).tobytes()

    def _buffer(self, number: Any) -> bytes:
        entry = self.item("buffers", number)
        if number not in self._buffers:
            uri = entry.get("uri")
            data = self.binary if uri is None and number == 0 else None
            if isinstance(uri, str):
                data = _data_uri(uri, self.path) if uri.startswith("data:") else _beside(uri, self.path)
            if data is None:
                raise MeshError(f"{self.path}: the data of its buffer {number} is missing; export it again.")
            self._buffers[number] = data
        return self._buffers[number]


def read_gltf_file(path: Path) -> GltfFile:
    """Read the JSON of a .gltf or .glb file, by content.

    Raises:
        MeshError: no glTF 2.0, cut short, or it requires an extension that is not supported.
    """
    data = path.read_bytes()
    binary = None
    if data[:4] == _MAGIC:
        version, length = (int.from_bytes(data[at : at + 4], "little") for at in (4, 8))
        if version != 2:
            raise MeshError(f"{path}: it is glTF of version {version}; export it as glTF 2.0.")
        if len(data) < length:
            raise MeshError(f"{path}: the file is cut short ({len(data)} of {length} bytes are there); copy it again.")
        data, binary = _chunks(data, path)
    try:
        content = json.loads(data.decode("utf-8-sig"))
    except (ValueError, RecursionError) as error:
        raise MeshError(f"{path}: it is not a readable glTF file (damaged or cut short); export it again.") from error
    if not isinstance(content, dict):
        raise MeshError(f"{path}: it is not a glTF file; export it as glTF 2.0.")
    required = content.get("extensionsRequired")
    for name in required if isinstance(required, list) else []:
        if str(name) not in _SUPPORTED and not str(name).startswith(_APPEARANCE):
            raise MeshError(f"{path}: it needs {str(name)[:60]}, which is not supported; export it without.")
    return GltfFile(path, content, binary)


def whole(entry: dict[str, Any], key: str, path: Path, default: int | None = None) -> int:
    """Read a number of the JSON that must be whole and not negative.

    Raises:
        MeshError: it is missing or none.
    """
    value = entry.get(key, default)
    if isinstance(value, float) and value.is_integer():
        return whole({key: int(value)}, key, path)
    if not isinstance(value, int) or isinstance(value, bool) or not 0 <= value < 2**53:
        raise MeshError(f"{path}: its {key} is {str(value)[:20]}, not a whole number; export it again.")
    return value


def _chunks(data: bytes, path: Path) -> tuple[bytes, bytes | None]:
    found: dict[bytes, bytes] = {}
    at = 12
    while at + 8 <= len(data):
        length, kind = int.from_bytes(data[at : at + 4], "little"), data[at + 4 : at + 8]
        if at + 8 + length > len(data):
            raise MeshError(f"{path}: the file is cut short; copy or export it again.")
        found.setdefault(kind, data[at + 8 : at + 8 + length])
        at += 8 + -(-length // 4) * 4
    if _JSON not in found:
        raise MeshError(f"{path}: it is not a readable .glb file (damaged or cut short); export it again.")
    return found[_JSON], found.get(_BINARY)


def _data_uri(uri: str, path: Path) -> bytes:
    head, _, body = uri.partition(",")
    try:
        return base64.b64decode(unquote(body), validate=False) if head.endswith(";base64") else unquote(body).encode()
    except (binascii.Error, ValueError) as error:
        raise MeshError(f"{path}: the data in one of its buffers is damaged; export it again.") from error


def _beside(uri: str, path: Path) -> bytes:
    """Read a file in or below the folder of the glTF file; its name may be percent-encoded."""
    if re.match(r"[A-Za-z][A-Za-z0-9+.-]+:", uri):
        raise MeshError(f"{path}: its data lies at {uri[:60]}, which is not read; export it as one .glb.")
    for name in dict.fromkeys((unquote(uri), uri, unquote(uri).replace("\\", "/"))):
        relative = Path(name)
        is_far = relative.is_absolute() or ".." in relative.parts or "\0" in name
        if is_far or (len(name) < 1024 and leads_outside(path.parent / relative, path)):
            raise MeshError(f"{path}: its data ({name[:60]!r}) lies outside of its folder; export it as one .glb.")
        if len(name) < 1024 and (path.parent / relative).exists():
            check_file(path.parent / relative, MeshError)
            return (path.parent / relative).read_bytes()
    raise MeshError(f"{path}: its data {unquote(uri)[:80]!r} is not beside it; copy both, or export it as one .glb.")
