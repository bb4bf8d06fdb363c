"""Points of text files: .xyz, .txt, .csv, .asc and .pts."""

from __future__ import annotations

import re
from collections.abc import Iterator
from itertools import chain, islice
from pathlib import Path

import numpy as np

from kpred.errors import ScanError
from kpred.shapes.formats.column_names import are_numbers_of_columns, name_columns
from kpred.shapes.formats.records import number_of, split_line, text_records, truncated
from kpred.shapes.formats.text_lines import open_lines

_HEADER_LINES = 32
_SAMPLE_LINES = 64
"""Rows that a column must count through, one by one, to be taken for numbers of rows."""


_MIN_ROWS = 16
_BLANKS = bytes.maketrans(b"()[]{}", b"      ")
_BRACKETS = (b"(", b"[", b"{", b")", b"]", b"}")
_VECTOR = re.compile(rb"\s*<?\s*[A-Za-z_][\w.]*\s*\(([^()]*)\)\s*>?\s*[,;]?\s*")
"""A point as programs print it: `Vector3(0.1, 0.2, 0.3)`, `<Vector (0.1, 0.2, 0.3)>`."""


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
        lines = map(_plain_line, stream)
        names: tuple[list[bytes], bool] | None = None
        is_indexed, wanted, titles = False, None, []
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
            words = bare.split(b"\t") if b"\t" in bare else values
            columns = name_columns(words)
            if columns is not None:
                names = words, is_comment
            elif not content or is_comment:
                continue
            elif len(values) == 1 and values[0].isdigit() and wanted is None:
                wanted = min(int(values[0][:18]), 10**15)
            elif wanted is None and are_numbers_of_columns(values[1:] if values[0] == b"" else values):
                is_indexed, names = values[0] == b"", None
            elif _is_row(values, None if names is None else name_columns(names[0])):
                break
            else:
                titles.append(values)
        else:
            raise ScanError(f"{path}: it holds no points; give a scan with at least 64 points.")
        sample = [content + b"\n", *islice(lines, _SAMPLE_LINES - 1)]
        columns = (1, 2, 3) if is_indexed else None if names is None else _named_columns(*names, sample)
        if columns is None:
            # A title may follow the count of points (XMol).
            _check_titles(titles if wanted is None else [], len(values), path)
            columns = _unnamed_columns(sample)
        found = 0
        for rows in text_records(chain(sample, lines), columns, str(path), number, wanted is not None):
            found += len(rows)
            yield rows
        if wanted is not None and found < wanted:
            raise truncated(str(path), found, wanted)


def _plain_line(line: bytes) -> bytes:
    """Write a line with blanks and minus signs of ASCII, and without the brackets around a point."""
    if not line.isascii():
        line = line.replace(b"\xc2\xa0", b" ").replace(b"\xe2\x88\x92", b"-")
    first = line.lstrip()[:1]
    if first in _BRACKETS:
        return line.translate(_BLANKS)
    vector = _VECTOR.fullmatch(line) if first == b"<" or first.isalpha() else None
    return line if vector is None else vector[1] + b"\n"


def _named_columns(names: list[bytes], is_comment: bool, sample: list[bytes]) -> tuple[int, int, int] | None:
    """Find the columns of named coordinates in the rows that follow; None where the names cannot be theirs."""
    rows = _split_rows(sample)
    width = len(rows[0])
    # Names may end a sentence: "# columns: x y z intensity".
    ending = name_columns(names[-width:]) if is_comment and len(names) > width else None
    columns = ending or name_columns(names)
    if columns is None or (is_comment and max(columns) >= width):
        return None
    x, y, z = columns
    # R and pandas write no name above the labels of rows.
    return (x + 1, y + 1, z + 1) if not is_comment and width == len(names) + 1 and _has_labels(rows) else columns


def _has_labels(rows: list[list[bytes]]) -> bool:
    """Test whether the first column labels rows: words, or whole numbers that grow."""
    labels = [row[0].strip(b"\"'") for row in rows]
    if not any(map(_is_number, labels)):
        return True
    if not all(label.isdigit() and len(label) < 12 for label in labels):
        return False
    numbers = [int(label) for label in labels]
    return all(a < b for a, b in zip(numbers, numbers[1:], strict=False))


def _split_rows(sample: list[bytes]) -> list[list[bytes]]:
    return [split_line(line.split(b"#", 1)[0]) for line in sample if line.strip()]


def _is_row(values: list[bytes], columns: tuple[int, int, int] | None) -> bool:
    """Test whether the named columns are numbers, or the first three, or the next three after one word."""
    if columns is not None and len(values) > max(columns) and all(_is_number(values[column]) for column in columns):
        return True
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
    rows = [row for row in _split_rows(sample) if len(row) >= 4]
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
