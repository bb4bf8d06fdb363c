"""Triangles of STL files, binary and text."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np

from kpred.errors import MeshError
from kpred.ops.typing import Float, Int
from kpred.shapes.formats.text_lines import text_encoding

_HEADER = 84
_RECORD = np.dtype([("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("attribute", "<u2")])
_VERTEX = re.compile(rb"vertex\s+(\S+)\s+(\S+)\s+(\S+)", re.IGNORECASE)
_END = re.compile(rb"end\s*solid", re.IGNORECASE)
_FACET_END = re.compile(rb"end\s*facet", re.IGNORECASE)


def read_stl(path: Path) -> tuple[Float[np.ndarray, "vertices 3"], Int[np.ndarray, "faces 3"]]:
    """Read (V, 3) float64 vertices and (F, 3) int64 faces; vertices at exactly the same place become one.

    A binary file may hold more bytes than its triangles. Where its count of triangles is 0 although triangles follow,
    as programs leave it that write in one pass, their number follows from the size.

    Raises:
        MeshError: neither a binary nor a text STL file, or cut short.
    """
    data = path.read_bytes()
    encoding = text_encoding(data[:65536])
    if encoding is not None:
        data = data.decode(encoding, errors="replace").encode()
    # Binary files may begin with "solid" too, so the size decides first.
    count = int.from_bytes(data[80:_HEADER], "little") if len(data) >= _HEADER else -1
    size = len(data) - _HEADER
    is_text = data.removeprefix(b"\xef\xbb\xbf").lstrip()[:5].lower() == b"solid" and b"\x00" not in data[:_HEADER]
    if count > 0 and size >= count * _RECORD.itemsize and not (is_text and _END.search(data[-1024:])):
        corners = _binary(data, count)
    elif is_text:
        corners = _text(data, path)
    elif count == 0 and size > 0 and size % _RECORD.itemsize == 0:
        corners = _binary(data, size // _RECORD.itemsize)
    elif count == 0 and size == 0:
        corners = np.zeros((0, 3))
    else:
        raise MeshError(f"{path}: it is not a whole STL file (damaged or cut short); copy or export it again.")
    return _welded(corners)


def _binary(data: bytes, count: int) -> np.ndarray:
    records = np.frombuffer(data, dtype=_RECORD, count=count, offset=_HEADER)
    return records["corners"].reshape(-1, 3).astype(np.float64)


def _text(data: bytes, path: Path) -> np.ndarray:
    found = _VERTEX.findall(data)
    whole = len(found) % 3 == 0 and len(found) == 3 * len(_FACET_END.findall(data)) and _END.search(data[-65536:])
    if not whole:
        raise MeshError(f"{path}: it is not a whole STL file (damaged or cut short); copy or export it again.")
    try:
        words = np.array(found, dtype=np.bytes_)
        if any(b"," in word for corner in found[:1024] for word in corner):  # Decimal commas.
            words = np.char.replace(words, b",", b".")
        return words.astype(np.float64).reshape(-1, 3)
    except ValueError as error:
        raise MeshError(f"{path}: a vertex does not hold three numbers; export the mesh again.") from error


def _welded(corners: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Weld corners (3 F, 3): the unique ones in lexical order, and the faces (F, 3)."""
    if not len(corners):
        return corners, np.zeros((0, 3), dtype=np.int64)
    points = corners + 0.0  # -0.0 becomes 0.0
    order = np.lexsort(points.T)
    ordered = points[order]
    first = np.concatenate([[True], (ordered[1:] != ordered[:-1]).any(axis=1)])
    rows = np.empty(len(points), dtype=np.int64)
    rows[order] = np.cumsum(first) - 1
    return ordered[first], rows.reshape(-1, 3)
