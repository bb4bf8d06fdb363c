"""Points of PCD files (Point Cloud Library): ascii, binary and binary_compressed."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import IO

import numpy as np

from kpred.errors import ScanError
from kpred.shapes.formats.lzf import decompress_lzf
from kpred.shapes.formats.records import BLOCK_ROWS, binary_records, text_records, truncated

_KINDS = ("f2", "f4", "f8", "i1", "i2", "i4", "i8", "u1", "u2", "u4", "u8")
_MAX_COUNT = 65536
"""Numbers of one field; descriptors have some hundred."""


@dataclass(frozen=True)
class _Header:
    fields: list[str]
    kinds: list[str]  # numpy types, such as f4
    counts: list[int]
    points: int
    data: str
    lines: int


def pcd_points(path: Path) -> Iterator[np.ndarray]:
    """Yield (n, 3) float64 blocks of the points of a PCD file, in the file's coordinates (VIEWPOINT is not applied).

    Raises:
        ScanError: damaged header, no fields x, y and z, cut short, or an unknown kind of data.
    """
    with open(path, "rb") as stream:
        header = _read_header(stream, path)
        if not {"x", "y", "z"} <= set(header.fields):
            raise ScanError(f"{path}: it has no fields x, y and z; export the scan with coordinates.")
        if header.data == "ascii":
            if header.points > path.stat().st_size:  # A point takes at least one byte.
                raise truncated(str(path), 0, header.points)
            starts = [sum(header.counts[: header.fields.index(axis)]) for axis in "xyz"]
            columns = (starts[0], starts[1], starts[2])
            found = 0
            for rows in text_records(stream, columns, str(path), header.lines + 1):
                found += len(rows)
                yield rows
            if found < header.points:
                raise truncated(str(path), found, header.points)
        elif header.data == "binary":
            # Padding fields are all called "_", so only the first of a name keeps it.
            entries = [
                (name if name not in header.fields[:i] else f"{name} {i}", f"<{kind}", (count,) if count > 1 else ())
                for i, (name, kind, count) in enumerate(zip(header.fields, header.kinds, header.counts, strict=True))
            ]
            yield from binary_records(stream, np.dtype(entries), header.points, str(path))
        elif header.data == "binary_compressed":
            yield from _compressed(stream, header, path)
        else:
            raise ScanError(f"{path}: its DATA is {header.data}; save it as ascii, binary or binary_compressed.")


def _compressed(stream: IO[bytes], header: _Header, path: Path) -> Iterator[np.ndarray]:
    lengths = stream.read(8)
    if len(lengths) < 8:
        raise truncated(str(path), 0, header.points)
    sizes = np.frombuffer(lengths, dtype="<u4")
    packed = stream.read(min(int(sizes[0]), path.stat().st_size))
    if len(packed) < sizes[0]:
        raise truncated(str(path), 0, header.points)
    widths = [int(kind[1:]) * count for kind, count in zip(header.kinds, header.counts, strict=True)]
    try:
        if int(sizes[1]) != sum(widths) * header.points:
            raise ValueError("the size does not match the fields")
        data = decompress_lzf(packed, int(sizes[1]))
    except ValueError as error:
        raise ScanError(f"{path}: its compressed points are damaged ({error}); copy it again.") from error
    # Field after field: all x, then all y, and so on.
    starts = np.cumsum([0, *(width * header.points for width in widths)])
    columns = []
    for axis in "xyz":
        at = header.fields.index(axis)
        values = np.frombuffer(data, f"<{header.kinds[at]}", header.points * header.counts[at], int(starts[at]))
        columns.append(values[:: header.counts[at]])
    for start in range(0, header.points, BLOCK_ROWS):
        yield np.stack([column[start : start + BLOCK_ROWS].astype(np.float64) for column in columns], axis=1)


def _read_header(stream: IO[bytes], path: Path) -> _Header:
    entries: dict[str, list[str]] = {}
    for number in range(1, 64):  # noqa: B007 (its last value is the number of header lines)
        words = stream.readline(65536).decode("latin-1").split("#", 1)[0].split()
        if words:
            entries[words[0].upper()] = words[1:]
        if "DATA" in entries:
            break
    try:
        fields = [field.lower() for field in entries.get("FIELDS", entries.get("COLUMNS", []))]
        counts = [int(count) for count in entries.get("COUNT", ["1"] * len(fields))]
        kinds = [
            {"F": "f", "I": "i", "U": "u"}[kind.upper()] + str(int(size))
            for kind, size in zip(entries["TYPE"], entries["SIZE"], strict=True)
        ]
        height = int(entries.get("HEIGHT", ["1"])[0])
        points = int(entries["POINTS"][0]) if "POINTS" in entries else int(entries["WIDTH"][0]) * height
        if not all(kind in _KINDS for kind in kinds):
            raise ValueError("an unknown type of field")
        if not len(fields) == len(kinds) == len(counts) or points < 0:
            raise ValueError("lists of the header differ in length")
        if not all(0 < count <= _MAX_COUNT for count in counts) or not 0 <= points < 2**40:
            raise ValueError("an impossible count")
        return _Header(fields, kinds, counts, points, entries["DATA"][0].lower(), number)
    except (KeyError, IndexError, ValueError, TypeError) as error:
        raise ScanError(f"{path}: its PCD header is damaged or cut short; export the scan again.") from error
