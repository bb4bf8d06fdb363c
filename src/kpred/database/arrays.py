"""An array as the columns of a row: dtype, shape, step, codec and bytes, little-endian and compressed where it pays."""

from __future__ import annotations

import math
import zlib
from typing import Any

import numpy as np


class DamagedArray(ValueError):
    """Bytes or numbers that do not make up the array they should."""


def pack_array(array: np.ndarray, dtype: str, step: float | None = None) -> dict[str, Any]:
    """Pack an array into the columns dtype, shape, step, codec, data.

    With a `step` the array is stored as whole multiples of it, in the integers `dtype` or, where these are too small,
    in int32; as float32 where float32 would not hold the multiples exactly. The bytes are compressed in the order that
    makes them smallest (`_ORDERS`), and left as they are where that does not pay.
    """
    source = np.asarray(array)
    if step is not None:
        multiples = np.rint(np.asarray(source, dtype=np.float64) / step)
        largest = np.abs(multiples).max(initial=0.0)
        if largest <= _EXACT:
            source, dtype = multiples, dtype if largest <= np.iinfo(dtype).max else "<i4"
        else:
            source, dtype, step = on_grid(source, step), "<f4", None
    stored = np.ascontiguousarray(source.astype(dtype))
    codec, data = "raw", stored.tobytes()
    least = 0.97 * len(data)
    by_column = stored.ndim > 1 and 0 < stored.shape[-1] <= _MAX_COLUMNS
    for name in _ORDERS if by_column else _ORDERS[:1]:
        packed = compress(_shuffled(stored, name))
        if len(packed) < least:
            codec, data, least = name, packed, len(packed)
    shape = ",".join(str(size) for size in stored.shape)
    return {"dtype": dtype, "shape": shape, "step": step, "codec": codec, "data": data}


def compress(data: bytes) -> bytes:
    """Compress by zlib as small as its settings allow: filtered data has other lengths of repeats than text."""
    settings = _SETTINGS if len(data) <= _MAX_TRIED else _SETTINGS[:1]
    found = []
    for memory, strategy in settings:
        deflate = zlib.compressobj(9, zlib.DEFLATED, zlib.MAX_WBITS, memory, strategy)
        found.append(deflate.compress(data) + deflate.flush())
    return min(found, key=len)


def unpack_array(dtype: str, shape: str, step: float | None, codec: str, data: bytes) -> np.ndarray:
    """Undo `pack_array`: float32 for floats and stepped arrays, int32 or int16 for integers; always writable.

    Raises DamagedArray.
    """
    try:
        kind, sizes = np.dtype(dtype), [int(size) for size in shape.split(",")]
        array = _unpacked(kind, sizes, codec, data)
    except (zlib.error, ValueError, TypeError) as error:
        raise DamagedArray(f"{len(data)} bytes ({codec}) are no {dtype} array of shape {shape}") from error
    if step is not None:
        return array.astype(np.float32) * np.float32(step)
    if kind.kind == "f":
        return array.astype(np.float32)
    return array.astype(np.int16 if kind in _SMALL else np.int32)


def _shuffled(stored: np.ndarray, order: str) -> bytes:
    columns = stored.reshape(-1, stored.shape[-1]).T if order == "columns-zlib" else stored
    return np.frombuffer(columns.tobytes(), np.uint8).reshape(-1, stored.itemsize).T.tobytes()


def inflate(data: bytes, size: int) -> bytes:
    """Decompress data of zlib that must have `size` bytes; no more memory is taken, whatever the data says.

    Raises:
        ValueError: another size, or an impossible one.
    """
    if not 0 <= size <= _MAX_BYTES:
        raise ValueError(f"{size} bytes")
    # A limit of 0 would be none.
    found = zlib.decompressobj().decompress(data, size + 1)
    if len(found) != size:
        raise ValueError("another size")
    return found


def _unpacked(kind: np.dtype[Any], sizes: list[int], codec: str, data: bytes) -> np.ndarray:
    if codec == "raw":
        return np.frombuffer(data, kind).reshape(sizes)
    if codec not in _ORDERS:
        raise ValueError(codec)
    plain = np.frombuffer(inflate(data, math.prod(sizes) * kind.itemsize), np.uint8)
    numbers = np.frombuffer(plain.reshape(kind.itemsize, -1).T.tobytes(), kind)
    return (numbers.reshape(sizes[-1], -1).T if codec == "columns-zlib" else numbers).reshape(sizes)


def on_grid(array: np.ndarray, step: float) -> np.ndarray:
    """Round to whole multiples of `step`, as float32: what `unpack_array` gives back of a stepped array."""
    return np.rint(np.asarray(array, dtype=np.float64) / step).astype(np.float32) * np.float32(step)


_ORDERS = ("shuffle-zlib", "columns-zlib")
"""Orders of bytes before compression by zlib: all first bytes of the numbers together, then all second ones and so on
(the high bytes are alike); the same after putting the first columns of all rows together, then the second ones."""

_SETTINGS = ((8, zlib.Z_DEFAULT_STRATEGY), (8, zlib.Z_FILTERED), (6, zlib.Z_FILTERED))
"""Memory levels and strategies of zlib that are tried; a low level gives each few kilobytes codes of their own."""

_MAX_BYTES = 1 << 28
"""Of one array, decompressed; those of a model of a million faces take a tenth."""

_MAX_TRIED = 1 << 20
"""Larger arrays are compressed once, by zlib's own settings."""

_MAX_COLUMNS = 8
"""Coordinates and corners are alike by column; of wider arrays it is not tried."""

_SMALL = tuple(np.dtype(name) for name in ("<i1", "<u1", "<i2"))

_EXACT = 2**24
"""Integers up to this are numbers of float32."""
