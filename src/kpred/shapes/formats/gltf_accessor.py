"""Arrays of glTF files: accessors with their strides, normalisation and sparse values."""

from __future__ import annotations

from typing import Any

import numpy as np

from kpred.errors import MeshError
from kpred.shapes.formats.gltf_file import GltfFile, whole

_TYPES = {5120: "i1", 5121: "u1", 5122: "<i2", 5123: "<u2", 5125: "<u4", 5126: "<f4"}
_WIDTHS = {"SCALAR": 1, "VEC2": 2, "VEC3": 3, "VEC4": 4, "MAT4": 16}
_MAX_COUNT = 1 << 26
"""Elements of an accessor without data of its own, which costs nothing in the file."""


def read_accessor(file: GltfFile, number: Any) -> np.ndarray:
    """Read the array (N, width) of an accessor; normalised integers become fractions of 1.

    Raises:
        MeshError: it refers to what is not there, or to fewer bytes than it needs.
    """
    values = read_stored_accessor(file, number)
    if file.item("accessors", number).get("normalized") is True and values.dtype.kind in "iu":
        # glTF 2.0, 3.11: the lowest signed integer is -1 too.
        return np.maximum(values.astype(np.float64) / np.iinfo(values.dtype).max, -1.0)
    return values


def read_stored_accessor(file: GltfFile, number: Any) -> np.ndarray:
    """(N, width) array of an accessor in the numbers that are stored, normalised or not.

    Raises:
        MeshError: it refers to what is not there, or to fewer bytes than it needs.
    """
    accessor = file.item("accessors", number)
    count = whole(accessor, "count", file.path)
    dtype, width = _layout(file, accessor)
    if accessor.get("bufferView") is None:
        if count > _MAX_COUNT:
            raise MeshError(f"{file.path}: one of its arrays has {count} entries and no data; export it again.")
        values = np.zeros((count, width), dtype=dtype)
    else:
        data, stride = file.view(accessor["bufferView"])
        values = _strided(file, data, stride, whole(accessor, "byteOffset", file.path, 0), dtype, (count, width))
    if isinstance(accessor.get("sparse"), dict):
        values = _sparse(file, accessor["sparse"], values)
    return values


def _layout(file: GltfFile, entry: dict[str, Any]) -> tuple[np.dtype, int]:
    kind, width = _TYPES.get(_hashable(entry.get("componentType"))), _WIDTHS.get(_hashable(entry.get("type", "SCALAR")))
    if kind is None or width is None:
        raise MeshError(f"{file.path}: one of its arrays is of an unknown type; export it again.")
    return np.dtype(kind), width


def _hashable(value: Any) -> Any:
    return value if isinstance(value, int | str) else None


def _strided(
    file: GltfFile, data: bytes, stride: int | None, start: int, dtype: np.dtype, shape: tuple[int, int]
) -> np.ndarray:
    count, width = shape
    step = stride or dtype.itemsize * width
    needed = start + step * (count - 1) + dtype.itemsize * width if count else 0
    if needed > len(data):
        raise MeshError(f"{file.path}: its data ends before its meshes do (cut short?); copy it again.")
    if not count:
        return np.zeros(shape, dtype=dtype)
    return np.ndarray(shape, dtype, data, start, (step, dtype.itemsize)).copy()


def _sparse(file: GltfFile, sparse: dict[str, Any], values: np.ndarray) -> np.ndarray:
    """Apply the sparse values to the base values."""
    count = whole(sparse, "count", file.path)
    places, changes = sparse.get("indices"), sparse.get("values")
    if not isinstance(places, dict) or not isinstance(changes, dict):
        raise MeshError(f"{file.path}: one of its sparse arrays is incomplete; export it again.")
    place_type, _ = _layout(file, {"componentType": places.get("componentType")})
    data, stride = file.view(places.get("bufferView"))
    rows = _strided(file, data, stride, whole(places, "byteOffset", file.path, 0), place_type, (count, 1))[:, 0]
    data, stride = file.view(changes.get("bufferView"))
    start = whole(changes, "byteOffset", file.path, 0)
    changed = _strided(file, data, stride, start, values.dtype, (count, values.shape[1]))
    if count and (rows.dtype.kind == "f" or rows.min() < 0 or rows.max() >= len(values)):
        raise MeshError(f"{file.path}: one of its sparse arrays changes what is not there; export it again.")
    result = values.copy()
    result[rows.astype(np.int64)] = changed
    return result
