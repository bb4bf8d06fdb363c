"""Points of numpy files: .npy and .npz."""

from __future__ import annotations

import zipfile
import zlib
from collections.abc import Iterator
from pathlib import Path
from typing import IO

import numpy as np

from kpred.errors import ScanError
from kpred.shapes.records import BLOCK_ROWS, truncated

_KEYS = ("points", "xyz", "vertices")


def npy_points(path: Path) -> Iterator[np.ndarray]:
    """Yield (n, 3) float64 blocks of an array of shape (N, 3 or more).

    Raises:
        ScanError: not a numeric array of that shape, damaged or cut short.
    """
    with open(path, "rb") as stream:
        yield from _array_points(stream, str(path))


def npz_points(path: Path) -> Iterator[np.ndarray]:
    """Yield (n, 3) float64 blocks of the array named points, xyz or vertices, or of the only array.

    Raises:
        ScanError: none or several arrays could be meant, or the file is damaged.
    """
    try:
        with zipfile.ZipFile(path) as archive:
            names = [name.removesuffix(".npy") for name in archive.namelist()]
            if "vertex_offsets" in names:
                raise ScanError(f"{path}: it is a pack of many meshes, not a scan; give one object's points.")
            key = next((key for key in _KEYS if key in names), names[0] if len(names) == 1 else None)
            if key is None:
                raise ScanError(f"{path}: none of its arrays is named points, xyz or vertices; name one so.")
            with archive.open(f"{key}.npy") as stream:
                yield from _array_points(stream, f"{path} ({key})")
    except (zipfile.BadZipFile, zlib.error, KeyError, EOFError, NotImplementedError, RuntimeError) as error:
        raise ScanError(f"{path}: it is not a readable .npz file (damaged or cut short); copy it again.") from error


def _array_points(stream: IO[bytes] | zipfile.ZipExtFile, name: str) -> Iterator[np.ndarray]:
    try:
        version = np.lib.format.read_magic(stream)
        reader = np.lib.format.read_array_header_1_0 if version == (1, 0) else np.lib.format.read_array_header_2_0
        shape, by_column, dtype = reader(stream)
    except ValueError as error:
        raise ScanError(f"{name}: it is not a readable numpy array (damaged or cut short); copy it again.") from error
    if dtype.kind not in "fiu":
        raise ScanError(f"{name}: it holds {dtype}, not numbers; save the points as a float array of shape (N, 3).")
    if len(shape) != 2 or shape[1] < 3:
        raise ScanError(f"{name}: its shape is {shape}; save the points as an array of shape (N, 3).")
    count, width = shape
    if by_column:
        # Column after column: x, y and z are the first three; they have to be read whole.
        data = stream.read(3 * count * dtype.itemsize)
        if len(data) < 3 * count * dtype.itemsize:
            raise truncated(name, 0, count)
        columns = np.frombuffer(data, dtype=dtype).reshape(3, count)
        for start in range(0, count, BLOCK_ROWS):
            yield columns[:, start : start + BLOCK_ROWS].T.astype(np.float64)
        return
    done = 0
    while done < count:
        rows = min(BLOCK_ROWS, count - done)
        data = stream.read(rows * width * dtype.itemsize)
        if len(data) < rows * width * dtype.itemsize:
            raise truncated(name, done + len(data) // (width * dtype.itemsize), count)
        yield np.frombuffer(data, dtype=dtype).reshape(rows, width)[:, :3].astype(np.float64)
        done += rows
