"""Points of PTX files (Leica Cyclone): one or several scans, each with the transform of its scanner."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import chain, islice
from pathlib import Path

import numpy as np

from kpred.errors import ScanError
from kpred.shapes.formats.records import parse_numbers, text_records, truncated
from kpred.shapes.formats.text_lines import open_lines

_HEADER = 10
"""Lines: columns, rows, the scanner's position and three axes, and a matrix of four rows."""


def ptx_points(path: Path) -> Iterator[np.ndarray]:
    """Yield (n, 3) float64 blocks of the points of all scans of a file, in the frame that they share.

    Points at the scanner (0 0 0) are directions in which nothing was seen, and are left out.

    Raises:
        ScanError: a damaged header, a line without three numbers, or fewer points than the header says.
    """
    with open_lines(path) as stream:
        lines = (line for line in stream if line.strip())
        number = 1
        while first := next(lines, None):
            count, matrix = _read_header(list(chain([first], islice(lines, _HEADER - 1))), path)
            found = 0
            for rows in text_records(islice(lines, count), (0, 1, 2), str(path), number + _HEADER):
                found += len(rows)
                seen = rows[(rows != 0).any(axis=1)]
                yield seen @ matrix[:3, :3] + matrix[3, :3]
            if found < count:
                raise truncated(str(path), found, count)
            number += _HEADER + count


def _read_header(lines: list[bytes], path: Path) -> tuple[int, np.ndarray]:
    """Return the number of points and the matrix (4, 4), which acts on rows, of one scan."""
    wrong = ScanError(f"{path}: its PTX header is damaged or cut short; export the scan again.")
    if len(lines) < _HEADER or not all(line.strip().isdigit() and len(line.strip()) < 10 for line in lines[:2]):
        raise wrong
    count = int(lines[0]) * int(lines[1])
    if count > path.stat().st_size:  # A point takes at least one byte.
        raise truncated(str(path), 0, count)
    values = parse_numbers(b" ".join(lines[2:]))
    if values is None or len(values) != 28 or not np.isfinite(values).all():
        raise wrong
    return count, values[12:].reshape(4, 4)
