"""Rows of points from an open file, block by block, so that memory does not grow with the file."""

from __future__ import annotations

import warnings
from collections.abc import Iterable, Iterator
from itertools import islice
from typing import IO

import numpy as np

from kpred.errors import ScanError

BLOCK_ROWS = 65536

_SEPARATORS = bytes.maketrans(b",;\t|", b"    ")
_COMMENTS = (b"#", b"//", b"%")


def truncated(name: str, found: int, wanted: int) -> ScanError:
    """The error for a file that ends before its last point."""
    return ScanError(f"{name}: the file is cut short ({found} of {wanted} points are there); copy it again.")


def binary_records(stream: IO[bytes], dtype: np.dtype, count: int, name: str) -> Iterator[np.ndarray]:
    """Yield (n, 3) float64 blocks from ``count`` records of ``dtype``, which has fields x, y and z.

    Raises:
        ScanError: the stream ends early.
    """
    done = 0
    while done < count:
        data = stream.read(min(BLOCK_ROWS, count - done) * dtype.itemsize)
        rows = np.frombuffer(data, dtype=dtype, count=len(data) // dtype.itemsize)
        if not len(rows):
            raise truncated(name, done, count)
        done += len(rows)
        yield np.stack([rows[axis].astype(np.float64) for axis in "xyz"], axis=1)


def text_records(
    lines: Iterable[bytes],
    columns: tuple[int, int, int],
    name: str,
    first_line: int = 1,
    decimal_comma: bool = False,
) -> Iterator[np.ndarray]:
    """Yield (n, 3) float64 blocks from lines of numbers; empty lines and comments are skipped.

    Args:
        lines: separated by blanks, tabs, commas or semicolons.
        columns: where x, y and z stand in a line.
        name: of the file, for messages.
        first_line: number of the first of ``lines`` in the file, for messages.
        decimal_comma: 1,5 means one and a half, as in ``1,5;2,5;3,5``.

    Raises:
        ScanError: a line does not hold numbers in these columns.
    """
    iterator = iter(lines)
    while block := list(islice(iterator, BLOCK_ROWS)):
        if decimal_comma:
            block = [line.replace(b",", b".") for line in block]
        rows = _uniform_rows(block, columns)
        if rows is None:
            rows = _ragged_rows(block, columns, name, first_line)
        if len(rows):
            yield rows
        first_line += len(block)


def _uniform_rows(block: list[bytes], columns: tuple[int, int, int]) -> np.ndarray | None:
    """Parse lines that all hold the same number of numbers; None when they do not. About ten times faster."""
    width = len(split_line(block[0]))
    if width <= max(columns):
        return None
    text = b" ".join(block)
    if any(pair in text for pair in (b",,", b";;")):  # An empty column would shift those after it.
        return None
    text = text.translate(_SEPARATORS)
    widths = list(map(len, map(bytes.split, text.split(b"\n"))))
    if not set(widths) <= {0, width}:
        return None
    with warnings.catch_warnings():
        warnings.simplefilter("error", DeprecationWarning)
        try:
            values = np.fromstring(text.decode("ascii"), sep=" ")
        except (ValueError, DeprecationWarning):
            return None
    if len(values) != sum(widths):
        return None
    return values.reshape(-1, width)[:, columns]


def _ragged_rows(block: list[bytes], columns: tuple[int, int, int], name: str, first_line: int) -> np.ndarray:
    rows = []
    for number, line in enumerate(block, start=first_line):
        content = line.split(b"#", 1)[0].strip()
        if not content or content.startswith(_COMMENTS):
            continue
        values = split_line(content)
        try:
            rows.append([_number(values[column]) for column in columns])
        except (IndexError, ValueError):
            raise ScanError(
                f"{name}: line {number} does not hold x, y and z as numbers; mend or remove that line."
            ) from None
    return np.array(rows, dtype=np.float64).reshape(-1, 3)


def _number(token: bytes) -> float:
    # Microsoft runtimes print NaN as -nan(ind), 1.#QNAN or the like.
    return float("nan") if b"nan" in token.lower() else float(token)


def split_line(line: bytes) -> list[bytes]:
    """Columns of a line; separated by semicolons, commas (empty columns count) or white space."""
    for separator in (b";", b",", b"|"):
        if separator in line:
            return [column.strip() for column in line.strip().rstrip(separator).split(separator)]
    return line.split()
