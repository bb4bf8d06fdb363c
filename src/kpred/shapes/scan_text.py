"""Points of text files: .xyz, .txt, .csv, .asc and .pts."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import chain
from pathlib import Path

import numpy as np

from kpred.errors import ScanError
from kpred.shapes.records import split_line, text_records, truncated

_HEADER_LINES = 32


def text_points(path: Path) -> Iterator[np.ndarray]:
    """Yield (n, 3) float64 blocks of the points of a text file.

    A first line with a single whole number is the count of points (.pts). A line of column names tells where x, y and
    z stand; without one they are the first three columns. Further columns are ignored.

    Raises:
        ScanError: no numbers, a line without three numbers, or fewer points than the file's own count.
    """
    with open(path, "rb") as stream:
        columns, wanted = (0, 1, 2), None
        for number, line in enumerate(stream, start=1):
            content = line.removeprefix(b"\xef\xbb\xbf").strip()
            if b"\x00" in content or number > _HEADER_LINES:
                raise ScanError(f"{path}: it is not a text file of points; give lines of x y z, or another format.")
            # Comments first: "# x y z" and "//X Y Z" are how many programs write the names of columns.
            values = split_line(content.lstrip(b"#/% "))
            named = _named_columns(values)
            if named is not None:
                columns = named
            elif not content or content.startswith((b"#", b"//", b"%")):
                continue
            elif len(values) == 1 and values[0].isdigit() and wanted is None:
                wanted = int(values[0])
            elif _starts_with_number(values):
                break
        else:
            raise ScanError(f"{path}: it holds no points; give a scan with at least 64 points.")
        comma = b";" in content and b"," in content and b"." not in content
        found = 0
        for rows in text_records(chain([content + b"\n"], stream), columns, str(path), number, comma):
            found += len(rows)
            yield rows
        if wanted is not None and found < wanted:
            raise truncated(str(path), found, wanted)


def _named_columns(values: list[bytes]) -> tuple[int, int, int] | None:
    names = [value.strip().strip(b"\"'").lower() for value in values]
    for triple in ((b"x", b"y", b"z"), (b"//x", b"y", b"z")):
        if all(name in names for name in triple):
            return names.index(triple[0]), names.index(triple[1]), names.index(triple[2])
    return None


def _starts_with_number(values: list[bytes]) -> bool:
    try:
        float(values[0].replace(b",", b"."))
    except (IndexError, ValueError):
        return False
    return True
