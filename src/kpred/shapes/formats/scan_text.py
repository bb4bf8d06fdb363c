"""Points of text files: .xyz, .txt, .csv, .asc and .pts."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import chain, islice
from pathlib import Path

import numpy as np

from kpred.errors import ScanError
from kpred.shapes.formats.column_names import name_columns
from kpred.shapes.formats.records import number_of, split_line, text_records, truncated
from kpred.shapes.formats.text_lines import open_lines

_HEADER_LINES = 32
_SAMPLE_LINES = 64
"""Rows that a column must count through, one by one, to be taken for numbers of rows."""


_MIN_ROWS = 16
_BLANKS = bytes.maketrans(b"()[]", b"    ")


def text_points(path: Path) -> Iterator[np.ndarray]:
    """Yield (n, 3) float64 blocks of the points of a text file.

    A first line with a single whole number is the count of points (.pts); more such blocks may follow. A line of column
    names says where x, y and z stand; without one they are the first three columns of numbers, after names or running
    numbers of the points, or after row and column of the scanner. Further columns are ignored, and so are brackets.

    Raises:
        ScanError: no numbers, a line without three numbers, column names that are not understood, or fewer points than
            the file's own count.
    """
    with open_lines(path) as stream:
        lines = map(_without_brackets, stream)
        columns, wanted, titles = None, None, []
        for number, line in enumerate(lines, start=1):  # noqa: B007 (the number is used below)
            content = line.removeprefix(b"\xef\xbb\xbf").strip()
            if b"\x00" in content or number > _HEADER_LINES or len(content) > 65536:
                raise ScanError(f"{path}: it is not a text file of points; give lines of x y z, or another format.")
            if content[:5].lower() == b"ncols":
                raise ScanError(f"{path}: it is a raster of heights (ESRI grid), not points; export it as x y z.")
            is_comment = content.startswith((b"#", b"//", b"%"))
            # Comments too: "# x y z" and "//X Y Z" are how many programs write the names of columns.
            bare = content.lstrip(b"#/% ")
            values = split_line(bare)
            # Names may hold blanks where tabs separate them.
            named = name_columns(bare.split(b"\t") if b"\t" in bare else values)
            if named is not None:
                columns = named
            elif not content or is_comment:
                continue
            elif len(values) == 1 and values[0].isdigit() and wanted is None:
                wanted = min(int(values[0][:18]), 10**15)
            elif wanted is None and _numbers_columns(values):
                columns = (1, 2, 3) if values[0] == b"" else None
            elif _is_row(values):
                break
            else:
                titles.append(values)
        else:
            raise ScanError(f"{path}: it holds no points; give a scan with at least 64 points.")
        sample = [content + b"\n", *islice(lines, _SAMPLE_LINES - 1)]
        if columns is None:
            _check_titles(titles, len(values), path)
            columns = _unnamed_columns(sample)
        found = 0
        for rows in text_records(chain(sample, lines), columns, str(path), number, wanted is not None):
            found += len(rows)
            yield rows
        if wanted is not None and found < wanted:
            raise truncated(str(path), found, wanted)


def _without_brackets(line: bytes) -> bytes:
    return line.translate(_BLANKS) if line.lstrip()[:1] in (b"(", b"[") else line


def _numbers_columns(values: list[bytes]) -> bool:
    """Test whether this line numbers columns from 0, after an empty name or not, as pandas does for arrays."""
    named = values[1:] if values[:1] == [b""] else values
    return len(named) >= 3 and named == [str(number).encode() for number in range(len(named))]


def _is_row(values: list[bytes]) -> bool:
    """Test whether the first three columns are numbers, or the next three after one word."""
    return all(map(_is_number, values[:3])) and bool(values) or (len(values) >= 4 and all(map(_is_number, values[1:4])))


def _is_number(value: bytes) -> bool:
    try:
        number_of(value)
    except ValueError:
        return False
    return True


def _check_titles(titles: list[list[bytes]], width: int, path: Path) -> None:
    """Refuse a line of names, as many as there are columns, of which none is known as a coordinate."""
    # Only the last of them may name columns: those before it are titles.
    for values in titles[-1:]:
        if len(values) == width and width > 2 and not any(map(_is_number, values)):
            names = ", ".join(value.decode("utf-8", "replace")[:24] for value in values[:8])
            raise ScanError(f"{path}: its columns are named {names}; name those of the coordinates x, y and z.")


def _unnamed_columns(sample: list[bytes]) -> tuple[int, int, int]:
    """Return the first three columns, or those behind names, running numbers, or rows and columns of a scanner."""
    rows = [split_line(line.split(b"#", 1)[0]) for line in sample if line.strip()]
    rows = [row for row in rows if len(row) >= 4]
    if len(rows) < 2 or len(rows) < len(sample) // 2:
        return 0, 1, 2
    if not any(_is_number(row[0]) for row in rows):
        return 1, 2, 3
    if len(rows) < _MIN_ROWS:
        return 0, 1, 2
    width = min(map(len, rows))
    whole = [all(row[column].lstrip(b"+-").isdigit() for row in rows) for column in range(width)]
    if _is_running(rows, whole):
        return 1, 2, 3
    # FARO: row and column of the scanner, the point, its colour.
    if width >= 5 and whole[:5] == [True, True, False, False, False] and all(whole[5:]):
        return 2, 3, 4
    return 0, 1, 2


def _is_running(rows: list[list[bytes]], whole: list[bool]) -> bool:
    """Test whether the first column numbers the points: growing whole numbers before coordinates that change."""
    if not whole[0] or not all(row[0].isdigit() and len(row[0]) < 12 for row in rows) or all(whole[1:4]):
        return False
    numbers = [int(row[0]) for row in rows]
    steps = [b - a for a, b in zip(numbers, numbers[1:], strict=False)]
    kinds = [len({row[column] for row in rows}) for column in (1, 2, 3)]
    if numbers[0] in (0, 1) and set(steps) == {1}:
        # A profile of heights has growing whole x too, but one y; rows of a grid grow behind their one x.
        heights = [number_of(row[2]) for row in rows if _is_number(row[2])]
        return kinds[0] > 1 or heights == sorted(heights)
    return min(steps) > 0 and min(kinds) > len(rows) // 2 and not any(whole[1:4])
