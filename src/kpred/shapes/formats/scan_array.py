"""Points of numpy files: .npy and .npz."""

from __future__ import annotations

import lzma
import math
import re
import zipfile
import zlib
from collections.abc import Iterator
from pathlib import Path
from typing import IO, NamedTuple

import numpy as np

from kpred.errors import ScanError
from kpred.shapes.formats.records import BLOCK_ROWS, truncated

_KEYS = (
    *("points", "xyz", "vertices", "coords", "positions", "point_cloud", "pointcloud", "pc", "pos", "arr_0"),
    *("pcd", "cloud", "pts", "point", "verts", "v", "scan", "data", "coord", "position", "locations", "location"),
    *("locs", "loc", "pts3d", "points3d", "xyzrgb", "pcl", "p"),
)
_NO_POSITIONS = re.compile(
    r"(?<![a-z])(?:norm|col|rgb|label|inst|feat|intens|flow|track|uv|face|tri|idx|index|mask|sem)"
)
"""In the names of arrays that may be as large as those of positions."""

_MIN_POINTS = 64
"""Fewer are no scan, so that an array of fewer rows than this and at least as many columns has points as columns."""

_MAX_BYTES = 1 << 32
"""Of an array that must be read whole, because its coordinates do not lie point by point."""

_LARGE, _MAX_EXPANSION = 1 << 26, 100
"""Bytes of an array below which it may be all zeros; times that a larger one may grow when it is decompressed."""

_MAX_ARRAYS = 64
_MAX_WIDTH = 160
"""Values of a point, coordinates, colours and features; a wider table is a picture of depths."""

_MAX_PICTURE = 8192
_MAX_CHANNELS = 16
"""Values a point of an organised cloud: coordinates, normal, colour and the like."""


def npy_points(path: Path) -> Iterator[np.ndarray]:
    """Yield (n, 3) float64 blocks of an array of points.

    Arrays are (N, 3 or more), (3 or more, N), (H, W, 3 or more) of an organised cloud, or structured with fields x, y
    and z or one field of three numbers.

    Raises:
        ScanError: not a numeric array of that shape, damaged or cut short.
    """
    size = path.stat().st_size
    with open(path, "rb") as stream:
        yield from _array_points(stream, str(path), size)


def npz_points(path: Path) -> Iterator[np.ndarray]:
    """Yield (n, 3) float64 blocks of the array named points, xyz, vertices or the like, or of the only array.

    Raises:
        ScanError: none or several arrays could be meant, or the file is damaged.
    """
    try:
        with zipfile.ZipFile(path) as archive:
            names = [name.removesuffix(".npy") for name in archive.namelist()]
            if "vertex_offsets" in names:
                raise ScanError(f"{path}: it is a pack of many meshes, not a scan; give one object's points.")
            known = {name.lower(): name for name in names}
            key = next((known[key] for key in _KEYS if key in known), names[0] if len(names) == 1 else None)
            if key is None and {"x", "y", "z"} <= set(known):
                yield from _three_arrays(archive, [known[axis] for axis in "xyz"], path)
                return
            if key is None:
                key = _only_points(archive, names, path)
            check_expansion(archive.getinfo(f"{key}.npy"), str(path))
            with archive.open(f"{key}.npy") as stream:
                yield from _array_points(stream, f"{path} ({key})", archive.getinfo(f"{key}.npy").file_size)
    except (zipfile.BadZipFile, zlib.error, lzma.LZMAError, LookupError, EOFError, RuntimeError, ValueError) as error:
        raise ScanError(f"{path}: it is not a readable .npz file (damaged or cut short); copy it again.") from error


def _only_points(archive: zipfile.ZipFile, names: list[str], path: Path) -> str:
    """Return the name of the only array that can hold points."""
    found = []
    for name in names[:_MAX_ARRAYS]:
        with archive.open(f"{name}.npy") as stream:
            shape, _, dtype = array_header(stream, f"{path} ({name})")
        sides = [side for side in shape if side > 1]
        is_table = len(sides) in (2, 3) and 3 in (sides[-1], sides[0]) and math.prod(sides) >= 3 * _MIN_POINTS
        if is_table and dtype.kind in "fiu" and dtype.itemsize > 1 and not _NO_POSITIONS.search(name.lower()):
            found.append(name)
    if len(found) != 1:
        held = ", ".join(name[:24] for name in names[:8])
        raise ScanError(f"{path}: none of its arrays is named points, xyz or vertices (it holds {held}); name one so.")
    return found[0]


def _three_arrays(archive: zipfile.ZipFile, names: list[str], path: Path) -> Iterator[np.ndarray]:
    """Return the points whose coordinates are three arrays of one size."""
    axes = []
    for name in names:
        check_expansion(archive.getinfo(f"{name}.npy"), str(path))
        with archive.open(f"{name}.npy") as stream:
            shape, _, dtype = array_header(stream, f"{path} ({name})")
            if dtype.kind not in "fiu" or not shape or math.prod(shape) * dtype.itemsize > _MAX_BYTES:
                raise ScanError(f"{path}: its array {name} holds no coordinates; save the points as (N, 3).")
            axes.append(_whole(stream, f"{path} ({name})", math.prod(shape), dtype))
    if len({len(axis) for axis in axes}) != 1:
        raise ScanError(f"{path}: its arrays x, y and z differ in length; save the points as (N, 3).")
    yield from _blocks(np.stack([_floats(axis) for axis in axes], axis=1))


def _array_points(stream: IO[bytes] | zipfile.ZipExtFile, name: str, size: int) -> Iterator[np.ndarray]:
    shape, by_column, dtype = array_header(stream, name)
    count = 1
    for side in shape:
        count *= side
    if count * dtype.itemsize > size:
        width = shape[-1] if len(shape) > 1 else 1
        raise truncated(name, size // max(dtype.itemsize * width, 1), count // max(width, 1))
    if dtype.names is not None or dtype.subdtype is not None:
        yield from _structured(_whole(stream, name, count, dtype), name)
        return
    if dtype.kind not in "fiu":
        raise ScanError(f"{name}: it holds {dtype}, not numbers; save the points as a float array of shape (N, 3).")
    wrong = ScanError(f"{name}: its shape is {shape}; save the points as an array of shape (N, 3).")
    if len(shape) == 3 and dtype.itemsize == 1:
        raise ScanError(f"{name}: it is a picture of shape {shape}, not points; save the points as (N, 3) floats.")
    plain = _without_ones(shape)
    if len(plain) not in (2, 3) or 0 in shape:
        raise wrong
    if len(plain) == 2 and min(plain) >= _MIN_POINTS and max(plain) <= _MAX_PICTURE and plain[1] > _MAX_WIDTH:
        raise ScanError(f"{name}: its shape {shape} is that of a depth picture; give it to kpred fit-depth.")
    if len(plain) == 2 and plain[1] >= 3 and plain[0] >= _MIN_POINTS and not by_column and plain[1] <= _MAX_WIDTH:
        yield from _rows(stream, name, plain[0], plain[1], dtype)
        return
    data = _whole(stream, name, count, dtype)
    array = np.reshape(data, plain, order="F" if by_column else "C")
    yield from _blocks(_table(array, wrong))


def _without_ones(shape: tuple[int, ...]) -> tuple[int, ...]:
    """Drop sides of one, such as those of a batch, from a shape of three sides or more."""
    return tuple(side for side in shape if side != 1) if len(shape) > 2 else shape


def _table(array: np.ndarray, wrong: ScanError) -> np.ndarray:
    """Return the points (N, 3 or more) of a two-dimensional array, or of an organised cloud."""
    shape = array.shape
    if len(shape) == 3:
        if 3 <= shape[2] <= _MAX_CHANNELS and (shape[0] != 3 or shape[2] == 3):
            return array.reshape(-1, shape[2])
        if 3 <= shape[0] <= _MAX_CHANNELS:
            return array.reshape(shape[0], -1).T
        raise wrong
    if shape[1] >= _MIN_POINTS > shape[0]:
        if shape[0] < 3:
            raise wrong
        return array.T
    if shape[1] < 3:
        raise wrong
    return array


def check_expansion(member: zipfile.ZipInfo, name: str) -> None:
    """Refuse an array in an archive that is small and would be very large.

    Raises:
        ScanError: measurements never compress so well.
    """
    if member.file_size > _LARGE and member.file_size > _MAX_EXPANSION * max(member.compress_size, 1):
        times = member.file_size // max(member.compress_size, 1)
        raise ScanError(f"{name}: its {member.filename} would grow {times} times to be read; save the array again.")


class ArrayHeader(NamedTuple):
    """Shape, order (whether column by column) and type of the array in a .npy file."""

    shape: tuple[int, ...]
    by_column: bool
    dtype: np.dtype


def array_header(stream: IO[bytes] | zipfile.ZipExtFile, name: str) -> ArrayHeader:
    """Read the header of a .npy file, before memory is taken for its array.

    Raises:
        ScanError: damaged, or an array of Python objects.
    """
    try:
        version = np.lib.format.read_magic(stream)
        reader = np.lib.format.read_array_header_1_0 if version == (1, 0) else np.lib.format.read_array_header_2_0
        shape, by_column, dtype = reader(stream)
        if dtype.hasobject:
            raise ScanError(f"{name}: it holds Python objects, not numbers; save the points as a float array (N, 3).")
        if any(side < 0 for side in shape) or dtype.itemsize < 1:
            raise ValueError("a negative shape")
    except ScanError:
        raise
    except Exception as error:  # The header is a Python literal, whose parser raises errors of its own.
        raise ScanError(f"{name}: it is not a readable numpy array (damaged or cut short); copy it again.") from error
    return ArrayHeader(shape, bool(by_column), dtype)


def _rows(
    stream: IO[bytes] | zipfile.ZipExtFile, name: str, count: int, width: int, dtype: np.dtype
) -> Iterator[np.ndarray]:
    done = 0
    while done < count:
        rows = min(BLOCK_ROWS, count - done)
        data = stream.read(rows * width * dtype.itemsize)
        if len(data) < rows * width * dtype.itemsize:
            raise truncated(name, done + len(data) // (width * dtype.itemsize), count)
        yield _floats(np.frombuffer(data, dtype=dtype).reshape(rows, width)[:, :3])
        done += rows


def _whole(stream: IO[bytes] | zipfile.ZipExtFile, name: str, count: int, dtype: np.dtype) -> np.ndarray:
    wanted = count * dtype.itemsize
    if wanted > _MAX_BYTES:
        raise ScanError(f"{name}: its {wanted / 1e9:.0f} GB do not lie point by point; save it as rows of x, y, z.")
    data = stream.read(wanted)
    if len(data) < wanted:
        raise truncated(name, len(data) // dtype.itemsize, count)
    return np.frombuffer(data, dtype=dtype)


def _structured(records: np.ndarray, name: str) -> Iterator[np.ndarray]:
    """Return the points of records with fields x, y and z, or with one field of three numbers."""
    fields = {field.lower(): records[field] for field in records.dtype.names or ()}
    if {"x", "y", "z"} <= set(fields):
        columns = [fields[axis].reshape(len(records), -1)[:, 0] for axis in "xyz"]
        if all(column.dtype.kind in "fiu" for column in columns):
            yield from _blocks(np.stack([_floats(column) for column in columns], axis=1))
            return
    for field in (*_KEYS, "position", "point", "location"):
        found = fields.get(field)
        if found is not None and found.dtype.kind in "fiu" and found.ndim == 2 and found.shape[1] >= 3:
            yield from _blocks(found)
            return
    raise ScanError(f"{name}: its fields are {', '.join(fields)[:80]}; name those of the coordinates x, y and z.")


def _blocks(table: np.ndarray) -> Iterator[np.ndarray]:
    for start in range(0, len(table), BLOCK_ROWS):
        yield _floats(table[start : start + BLOCK_ROWS, :3])


def _floats(values: np.ndarray) -> np.ndarray:
    with np.errstate(invalid="ignore", over="ignore"):
        return values.astype(np.float64)
