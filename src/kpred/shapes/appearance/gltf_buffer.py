"""The binary part of a glTF file as it grows: arrays and bytes, each in a view of its own."""

from __future__ import annotations

import json
from typing import Any

import numpy as np

_TYPES = {"i1": 5120, "u1": 5121, "i2": 5122, "u2": 5123, "u4": 5125, "f4": 5126}
_WIDTHS = {1: "SCALAR", 2: "VEC2", 3: "VEC3", 4: "VEC4"}


class GltfBuffer:
    """Bytes, views and accessors of one buffer, in the order in which they were added."""

    def __init__(self, data: bytes = b"", content: dict[str, Any] | None = None) -> None:
        """Begin with the bytes, `bufferViews` and `accessors` of a file, or empty."""
        self.data = bytearray(data)
        self.views: list[dict[str, Any]] = list((content or {}).get("bufferViews", []))
        self.accessors: list[dict[str, Any]] = list((content or {}).get("accessors", []))

    def add_bytes(self, content: bytes) -> int:
        """Append bytes, aligned to four, and return the number of their view."""
        self.data += bytes(-len(self.data) % 4)
        self.views.append({"buffer": 0, "byteOffset": len(self.data), "byteLength": len(content)})
        self.data += content
        return len(self.views) - 1

    def add_array(self, array: np.ndarray, *, normalized: bool = False, with_bounds: bool = False) -> int:
        """Append an array (N, width) and return the number of its accessor; rows begin at multiples of four bytes."""
        values = np.ascontiguousarray(array, dtype=np.dtype(array.dtype).newbyteorder("<"))
        row = values.itemsize * values.shape[1]
        # Indices lie close together; attributes of vertices must not.
        stride = row if values.shape[1] == 1 else -(-row // 4) * 4
        padded = np.zeros((len(values), stride), np.uint8)
        padded[:, :row] = values.view(np.uint8).reshape(len(values), row)
        view = self.add_bytes(padded.tobytes())
        if stride != row:
            self.views[view]["byteStride"] = stride
        accessor: dict[str, Any] = {
            "bufferView": view,
            "componentType": _TYPES[f"{values.dtype.kind}{values.itemsize}"],
            "count": len(values),
            "type": _WIDTHS[values.shape[1]],
        }
        if normalized:
            accessor["normalized"] = True
        if with_bounds and len(values):
            accessor["min"], accessor["max"] = values.min(axis=0).tolist(), values.max(axis=0).tolist()
        self.accessors.append(accessor)
        return len(self.accessors) - 1

    def replace_array(self, number: int, array: np.ndarray) -> None:
        """Write other numbers over those of an accessor that `add_array` made, of the same shape and type."""
        view = self.views[self.accessors[number]["bufferView"]]
        data = np.ascontiguousarray(array, dtype=np.dtype(array.dtype).newbyteorder("<")).tobytes()
        if len(data) != view["byteLength"]:
            raise ValueError(f"accessor {number} holds {view['byteLength']} bytes, not {len(data)}")
        self.data[view["byteOffset"] : view["byteOffset"] + len(data)] = data

    def glb(self, content: dict[str, Any]) -> bytes:
        """Write a .glb of this JSON, its buffer, views and accessors set to these."""
        whole = content | {"accessors": self.accessors, "bufferViews": self.views}
        whole["buffers"] = [{"byteLength": len(self.data)}]
        whole = {key: value for key, value in whole.items() if value != [] or key in ("scenes", "nodes")}
        text = json.dumps(whole, separators=(",", ":")).encode()
        text += b" " * (-len(text) % 4)
        binary = bytes(self.data) + bytes(-len(self.data) % 4)
        chunks = (
            len(text).to_bytes(4, "little") + b"JSON" + text + len(binary).to_bytes(4, "little") + b"BIN\0" + binary
        )
        return b"glTF" + (2).to_bytes(4, "little") + (12 + len(chunks)).to_bytes(4, "little") + chunks
