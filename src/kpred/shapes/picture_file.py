"""Pictures whose values are measurements or numbers: depths, ids of objects."""

from __future__ import annotations

import math
import zipfile
import zlib
from pathlib import Path
from typing import IO

import numpy as np
from PIL import Image, UnidentifiedImageError

from kpred.errors import ScanError
from kpred.shapes.formats.scan_array import array_header, check_expansion
from kpred.shapes.reading import check_file, reading

_MAX_PIXELS = 1 << 25
"""Pixels of a picture of depths or ids; sensors have two million, and each takes 8 bytes, several times."""


_NAMES = {
    "depth picture": ("depth", "depths", "depth_map", "depthmap", "arr_0"),
    "mask": ("mask", "masks", "segmentation", "arr_0"),
}
"""Names of arrays in archives, by what they are."""

_BLACK, _MAX_BETWEEN = 64, 0.02
"""Values that count as black, and pixels of a mask between black and white, to all."""

_SOLID, _MIN_SHADES = 0.8, 5
"""Of an object with soft edges: pixels of full value to all, and different values."""


def read_picture(file: Path, extensions: tuple[str, ...], kind: str) -> np.ndarray:
    """Read one channel or several, (height, width, ...), as they are stored; palettes by index.

    Args:
        extensions: those that may be read.
        kind: what the picture is, for messages.

    Raises:
        ScanError: missing, unreadable, no picture, or too large.
    """
    if file.suffix.lower() not in extensions:
        raise ScanError(f"{file}: unknown extension {file.suffix!r} of a {kind}; use {', '.join(extensions)}.")
    check_file(file, ScanError, kind)
    with reading(file, ScanError, f"{file.suffix.lower()} {kind}"):
        if file.suffix.lower() == ".npy":
            with open(file, "rb") as stream:
                return _array(stream, file, file.stat().st_size, kind)
        if file.suffix.lower() == ".npz":
            return _archive(file, kind)
        try:
            with Image.open(file) as picture:
                if picture.width * picture.height > _MAX_PIXELS:
                    raise ScanError(f"{file}: {picture.width} x {picture.height} pixels are too many for a {kind}.")
                return np.asarray(picture)
        except UnidentifiedImageError as error:
            raise ScanError(f"{file}: it is not a picture; save the {kind} again.") from error
        except (OSError, ValueError, EOFError, SyntaxError, Image.DecompressionBombError) as error:
            raise ScanError(
                f"{file}: it cannot be read (damaged or cut short: {error}); save the {kind} again."
            ) from error


def one_channel(array: np.ndarray) -> np.ndarray:
    """Return (height, width) of a picture with one channel before or behind, others as they are."""
    while array.ndim > 3 and array.shape[0] == 1:
        array = array[0]
    if array.ndim == 3 and 1 in (array.shape[0], array.shape[2]):
        return array.reshape(array.shape[1:] if array.shape[0] == 1 else array.shape[:2])
    return array


def mask_channel(array: np.ndarray) -> np.ndarray:
    """Return the channel of a picture that is a mask: grey stored as colours, else alpha; whole floats as integers."""
    flat = one_channel(array)
    if flat.ndim == 3 and flat.dtype == np.uint8 and flat.shape[2] in (2, 3, 4):
        colors = flat[..., :3] if flat.shape[2] > 2 else flat[..., :1]
        alpha = flat[..., -1] if flat.shape[2] in (2, 4) else None
        if alpha is not None and alpha.min() == 0 and alpha.max() > 0 and np.ptp(colors[alpha > 0].astype(int)) != 0:
            return alpha
        if (colors == colors[..., :1]).all():
            return colors[..., 0] if alpha is None else np.where(alpha > 0, colors[..., 0], 0)
    if (
        flat.dtype.kind == "f"
        and np.isfinite(flat).all()
        and (flat == np.round(flat)).all()
        and (abs(flat) < 2**31).all()
    ):
        return flat.astype(np.int64)
    return flat


def has_soft_edges(array: np.ndarray) -> bool:
    """Test whether a mask of 8 bits is one object, 255, whose edge fades out, and not several ids."""
    if array.dtype != np.uint8:
        return False
    counts = np.bincount(array.ravel(), minlength=256)[1:]
    return bool(counts[-1] > _SOLID * counts.sum() and np.count_nonzero(counts) > _MIN_SHADES)


def lossy_mask(array: np.ndarray, file: Path) -> np.ndarray:
    """Return the pixels of one white object on black ground, (height, width) bool, of a picture that JPEG smeared.

    Raises:
        ScanError: other values than black and white.
    """
    between = np.count_nonzero((array > _BLACK) & (array < 255 - _BLACK))
    if array.ndim != 2 or array.dtype != np.uint8 or between > _MAX_BETWEEN * array.size:
        raise ScanError(f"{file}: JPEG changes the ids of a mask; save it as .png.")
    return np.asarray(array >= 128)


def _archive(file: Path, kind: str) -> np.ndarray:
    """Read the array of a .npz file that is named depth or mask, or its only one."""
    with zipfile.ZipFile(file) as archive:
        names = archive.namelist()
        wanted = _NAMES[kind]
        known = [name for name in names if name.removesuffix(".npy").lower() in wanted]
        if len(known) != 1 and len(names) != 1:
            raise ScanError(f"{file}: none of its arrays is named {wanted[0]} or {wanted[1]}; name the {kind} so.")
        name = (known or names)[0]
        check_expansion(archive.getinfo(name), str(file))
        with archive.open(name) as stream:
            return _array(stream, file, archive.getinfo(name).file_size, kind)


def _array(stream: IO[bytes] | zipfile.ZipExtFile, file: Path, size: int, kind: str) -> np.ndarray:
    """Read an array of the .npy format, after a check of its header; `size`: bytes that are there."""
    shape, by_column, dtype = array_header(stream, str(file))
    if dtype.kind not in "biuf":
        raise ScanError(f"{file}: it holds {dtype}, not numbers; save the {kind} as numbers.")
    pixels = math.prod(shape)
    if pixels > _MAX_PIXELS or pixels * dtype.itemsize > size:
        raise ScanError(f"{file}: an array of shape {shape} is not in it (damaged or cut short); copy it again.")
    try:
        values = np.frombuffer(stream.read(pixels * dtype.itemsize), dtype, pixels)
    except (ValueError, EOFError, zlib.error) as error:
        raise ScanError(f"{file}: it cannot be read (damaged or cut short: {error}); save the {kind} again.") from error
    return np.reshape(values, shape, order="F" if by_column else "C")
