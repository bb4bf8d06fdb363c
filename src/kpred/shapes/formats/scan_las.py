"""Points of LAS files (ASPRS, versions 1.0 to 1.4), uncompressed."""

from __future__ import annotations

import struct
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from kpred.errors import ScanError
from kpred.shapes.formats.records import BLOCK_ROWS, truncated

_MIN_HEADER = 227
_LAST_OLD_FORMAT = 5
"""Up to it, class and flags of a point share one byte."""

NOISE = (7, 18)
"""Classes of points that are errors: below the ground, in the air."""


def las_points(path: Path) -> Iterator[np.ndarray]:
    """Yield (n, 3) float64 blocks of the points of a LAS file, by its scale and offset.

    Points that are classified as noise or withheld are left out.

    Raises:
        ScanError: compressed (LAZ), damaged or cut short.
    """
    with open(path, "rb") as stream:
        header = stream.read(375)
        if header[:4] != b"LASF" or len(header) < _MIN_HEADER:
            raise ScanError(f"{path}: it is not a whole LAS file; give the right extension or export the scan again.")
        start, _, kind, width, count = struct.unpack_from("<IIBHI", header, 96)
        if header[25] >= 4 and len(header) >= 255:
            count = struct.unpack_from("<Q", header, 247)[0] or count
        if kind & 0xC0:
            raise ScanError(f"{path}: its points are compressed (LAZ); name it .laz, or save it as .ply.")
        scale, offset = np.array(struct.unpack_from("<6d", header, 131)).reshape(2, 3)
        if width < 20 or not np.isfinite([scale, offset]).all() or not (scale != 0).all():
            raise ScanError(f"{path}: its LAS header is damaged; export the scan again.")
        there = max(path.stat().st_size - start, 0) // width
        if count > there:
            raise truncated(str(path), there, count)
        stream.seek(start)
        for first in range(0, count, BLOCK_ROWS):
            rows = min(BLOCK_ROWS, count - first)
            records = np.frombuffer(stream.read(rows * width), np.uint8).reshape(rows, width)
            positions = np.ascontiguousarray(records[:, :12]).view("<i4")
            yield positions[_is_valid(records, kind)] * scale + offset


def _is_valid(records: np.ndarray, kind: int) -> np.ndarray:
    """Return which records (n, width) are neither noise nor withheld."""
    if kind <= _LAST_OLD_FORMAT:
        classes, withheld = records[:, 15] & 31, records[:, 15] & 128
    else:
        classes, withheld = records[:, 16], records[:, 15] & 4
    found: np.ndarray = ~np.isin(classes, NOISE) & (withheld == 0)
    return found
