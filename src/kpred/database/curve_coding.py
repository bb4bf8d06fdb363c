"""Bases of points and vertices as small numbers: differences along a curve through the places that they belong to.

Neighbouring points have similar weights, and the curve (Morton's) runs from neighbour to neighbour. The order is
computed from the points again when the array is read, so that it is not stored.
"""

from __future__ import annotations

import zlib
from typing import Any

import numpy as np

from kpred.database.arrays import DamagedArray, pack_array
from kpred.ops.typing import Float, Int

CODEC = "curve-zlib"
"""Name of this form in the column `codec`."""

_CELL_BITS = 9
"""The box of the places is divided into 2^9 cells along an axis."""


def pack_along_curve(
    array: Float[np.ndarray, "points k"], dtype: str, step: float, places: Float[np.ndarray, "points 3"]
) -> dict[str, Any]:
    """Pack an array as `pack_array` does, or as differences along the curve where that is smaller.

    Args:
        array: rows of points or vertices; dtype, step: as for `pack_array`.
        places: of the rows, as they are read from the database again.
    """
    packed = pack_array(array, dtype, step)
    if packed["step"] is None or not len(array):
        return packed
    kind = np.dtype(packed["dtype"])
    multiples = np.rint(np.asarray(array, np.float64) / step).astype(kind)[curve_order(places)]
    steps = np.diff(multiples, axis=0, prepend=np.zeros_like(multiples[:1]))
    # 0, -1, 1, -2, ... become 0, 1, 2, 3, ...: small numbers whose high bytes are all zero.
    folded = (steps << 1) ^ (steps >> (8 * kind.itemsize - 1))
    data = zlib.compress(np.frombuffer(folded.T.tobytes(), np.uint8).reshape(-1, kind.itemsize).T.tobytes(), 9)
    return packed | {"codec": CODEC, "data": data} if len(data) < len(packed["data"]) else packed


def unpack_along_curve(
    dtype: str, shape: str, step: float | None, data: bytes, places: Float[np.ndarray, "points 3"]
) -> Float[np.ndarray, "points k"]:
    """Undo `pack_along_curve` for an array of codec `CODEC`; float32.

    Raises:
        DamagedArray: the bytes make up no such array, or not one of so many places.
    """
    try:
        if step is None:
            raise ValueError("a curve without a step")
        kind, (count, columns) = np.dtype(dtype), (int(size) for size in shape.split(","))
        numbers = np.frombuffer(zlib.decompress(data), np.uint8).reshape(kind.itemsize, -1).T.tobytes()
        folded = np.frombuffer(numbers, kind.str.replace("i", "u")).reshape(columns, count).T
        steps = (folded >> 1).astype(kind) ^ -(folded & 1).astype(kind)
        found = np.empty((count, columns), np.float32)
        found[curve_order(places)] = np.cumsum(steps, axis=0, dtype=kind).astype(np.float32) * np.float32(step)
    except (zlib.error, ValueError, TypeError, IndexError) as error:
        raise DamagedArray(f"{len(data)} bytes ({CODEC}) are no {dtype} array of shape {shape}") from error
    return found


def curve_order(places: Float[np.ndarray, "points 3"]) -> Int[np.ndarray, " points"]:
    """Rows in the order of Morton's curve through the box of the places."""
    low, high = places.min(axis=0), places.max(axis=0)
    cells = 2**_CELL_BITS - 1
    scaled = (places - low) / np.maximum(np.float32((high - low).max()), np.float32(1e-30)) * np.float32(cells)
    with np.errstate(invalid="ignore"):  # damaged places are found by those who check them
        cell = np.clip(scaled.astype(np.int64), 0, cells)
    rank = np.zeros(len(places), np.int64)
    for bit in range(_CELL_BITS):
        for axis in range(3):
            rank |= ((cell[:, axis] >> bit) & 1) << (3 * bit + axis)
    order: np.ndarray = np.argsort(rank, kind="stable")
    return order
