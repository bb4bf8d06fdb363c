"""Pictures whose values are measurements or numbers: depths, ids of objects."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
from PIL import Image, UnidentifiedImageError

from kpred.errors import ScanError
from kpred.shapes.formats.scan_array import array_header
from kpred.shapes.reading import check_file, reading

_MAX_PIXELS = 1 << 26
"""Pixels of a picture of depths or ids; sensors have two million, and each takes 8 bytes."""


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
            return _array(file, kind)
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


def _array(file: Path, kind: str) -> np.ndarray:
    """Read the array of a .npy file, after a check of its header."""
    try:
        with open(file, "rb") as stream:
            shape, _, dtype = array_header(stream, str(file))
            if dtype.kind not in "biuf":
                raise ScanError(f"{file}: it holds {dtype}, not numbers; save the {kind} as numbers.")
            pixels = math.prod(shape)
            if pixels > _MAX_PIXELS or pixels * dtype.itemsize > file.stat().st_size:
                raise ScanError(
                    f"{file}: an array of shape {shape} is not in it (damaged or cut short); copy it again."
                )
        return np.asarray(np.load(file, allow_pickle=False))
    except (ValueError, EOFError) as error:
        raise ScanError(f"{file}: it cannot be read (damaged or cut short: {error}); save the {kind} again.") from error
