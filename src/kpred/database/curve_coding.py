"""Bases of points and vertices as small numbers: differences from what near points predict.

Neighbouring points have similar weights. Points are taken along a curve (Morton's) that runs from neighbour to
neighbour, and each is predicted from the two nearest of those before it. Order and neighbours are computed from the
points again when the array is read, so that they are not stored.
"""

from __future__ import annotations

import zlib
from typing import Any

import numpy as np

from kpred.database.arrays import DamagedArray, compress, inflate, pack_array
from kpred.database.predictions_cpu import add_predictions, remove_predictions
from kpred.ops.typing import Float, Int

CODEC = "neighbours-zlib"
"""Name of this form in the column `codec`."""

OLD_CODEC = "curve-zlib"
"""Form of databases before: differences from the point before on the curve. It is read, and written no more."""

CODECS = (CODEC, OLD_CODEC)

_CURVE_BITS = 9
"""The box of the places is divided into 2^9 cells along an axis for the curve."""

_NEIGHBOUR_BITS = 15
"""The same for distances between neighbours."""


def pack_along_curve(
    array: Float[np.ndarray, "points k"], dtype: str, step: float, places: Float[np.ndarray, "points 3"]
) -> dict[str, Any]:
    """Pack an array as `pack_array` does, or as differences from predictions where that is smaller.

    Args:
        array: rows of points or vertices; dtype, step: as for `pack_array`.
        places: of the rows, as they are read from the database again.
    """
    packed = pack_array(array, dtype, step)
    if packed["step"] is None or not len(array):
        return packed
    kind, order = np.dtype(packed["dtype"]), curve_order(places)
    multiples = np.rint(np.asarray(array, np.float64) / step).astype(np.int64)[order]
    differences = np.empty_like(multiples)
    remove_predictions(_cells(places, _NEIGHBOUR_BITS)[order], multiples, differences)
    wrapped = differences.astype(kind)
    # 0, -1, 1, -2, ... become 0, 1, 2, 3, ...: small numbers whose high bytes are all zero.
    folded = (wrapped << 1) ^ (wrapped >> (8 * kind.itemsize - 1))
    data = compress(np.frombuffer(folded.T.tobytes(), np.uint8).reshape(-1, kind.itemsize).T.tobytes())
    return packed | {"codec": CODEC, "data": data} if len(data) < len(packed["data"]) else packed


def unpack_along_curve(
    dtype: str, shape: str, step: float | None, codec: str, data: bytes, places: Float[np.ndarray, "points 3"]
) -> Float[np.ndarray, "points k"]:
    """Undo `pack_along_curve` for an array of a codec in `CODECS`; float32.

    Raises:
        DamagedArray: the bytes make up no such array, or not one of so many places.
    """
    try:
        if step is None:
            raise ValueError("differences without a step")
        kind, (count, columns) = np.dtype(dtype), (int(size) for size in shape.split(","))
        plain = inflate(data, count * columns * kind.itemsize)
        numbers = np.frombuffer(plain, np.uint8).reshape(kind.itemsize, -1).T.tobytes()
        folded = np.frombuffer(numbers, kind.str.replace("i", "u")).reshape(columns, count).T
        differences = (folded >> 1).astype(kind) ^ -(folded & 1).astype(kind)
        order = curve_order(places)
        if len(order) != count:
            raise ValueError(f"{len(order)} places")
        if codec == CODEC:
            multiples = np.ascontiguousarray(differences, np.int64)
            add_predictions(_cells(places, _NEIGHBOUR_BITS)[order], multiples, 8 * kind.itemsize)
        else:
            multiples = np.cumsum(differences, axis=0, dtype=kind)
        found = np.empty((count, columns), np.float32)
        found[order] = multiples.astype(np.float32) * np.float32(step)
    except (zlib.error, ValueError, TypeError, IndexError) as error:
        raise DamagedArray(f"{len(data)} bytes ({codec}) are no {dtype} array of shape {shape}") from error
    return found


def curve_order(places: Float[np.ndarray, "points 3"]) -> Int[np.ndarray, " points"]:
    """Rows in the order of Morton's curve through the box of the places."""
    cell = _cells(places, _CURVE_BITS)
    rank = np.zeros(len(places), np.int64)
    for bit in range(_CURVE_BITS):
        for axis in range(3):
            rank |= ((cell[:, axis] >> bit) & 1) << (3 * bit + axis)
    order: np.ndarray = np.argsort(rank, kind="stable")
    return order


def _cells(places: np.ndarray, bits: int) -> np.ndarray:
    """Find the cells (N, 3) int64 of places when the longest side of their box has 2^bits of them."""
    low, high = places.min(axis=0), places.max(axis=0)
    last = 2**bits - 1
    scaled = (places - low) / np.maximum(np.float32((high - low).max()), np.float32(1e-30)) * np.float32(last)
    with np.errstate(invalid="ignore"):  # damaged places are found by those who check them
        return np.clip(scaled.astype(np.int64), 0, last)
