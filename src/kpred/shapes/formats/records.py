"""Rows of points from an open file, block by block, so that memory does not grow with the file."""

from __future__ import annotations

import csv
import re
import warnings
from collections.abc import Iterable, Iterator
from itertools import islice
from typing import IO

import numpy as np

from kpred.errors import ScanError

BLOCK_ROWS = 65536

_MAX_DIGITS = 400
"""Characters of one number; more are damage, and slow to parse."""

_MAX_LINE = 1 << 20
_BLANK = b" \t\r\n\x00\x1a"
_COMMENTS = (b"#", b"//", b"%")
_FORTRAN = re.compile(rb"([+-]?\d*\.?\d*)[dD]([+-]?\d+)")
_THOUSANDS = re.compile(rb"[+-]?\d{1,3}(?:(?:\.\d{3})+,\d+|(?:\.\d{3}){2,}|(?:,\d{3})+\.\d+|(?:,\d{3}){2,})")
_MISSING = (b"", b"-", b"--", b"na", b"n/a", b"#n/a", b"null", b"none")
"""What programs write in lower or upper case where there is no number."""

_DECIMAL_COMMA = re.compile(rb"[+-]?\d*,\d+(?:[eE][+-]?\d+)?")


def truncated(name: str, found: int, wanted: int) -> ScanError:
    """Return the error for a file that ends before its last point."""
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
        with np.errstate(invalid="ignore", over="ignore"):
            # Of a field with several numbers the first is the coordinate.
            yield np.stack([rows[axis].astype(np.float64).reshape(len(rows), -1)[:, 0] for axis in "xyz"], axis=1)


def text_records(
    lines: Iterable[bytes], columns: tuple[int, int, int], name: str, first_line: int = 1, counted: bool = False
) -> Iterator[np.ndarray]:
    """Yield (n, 3) float64 blocks from lines of numbers; empty lines and comments are skipped.

    Args:
        lines: separated by blanks, tabs, semicolons or commas; ``1,5 2,5 3,5`` and ``1,5;2,5;3,5`` have decimal commas.
        columns: where x, y and z stand in a line.
        name: of the file, for messages.
        first_line: number of the first of ``lines`` in the file, for messages.
        counted: a line of one whole number is the count of a further part, and is skipped.

    Raises:
        ScanError: a line does not hold numbers in these columns.
    """
    iterator = iter(lines)
    while block := list(islice(iterator, BLOCK_ROWS)):
        rows = _uniform_rows(block, columns)
        if rows is None:
            rows = _ragged_rows(block, columns, name, first_line, counted)
        if len(rows):
            yield rows
        first_line += len(block)


def parse_numbers(text: bytes) -> np.ndarray | None:
    """Parse numbers (N,) float64 separated by white space; None for any other text."""
    with warnings.catch_warnings():
        warnings.simplefilter("error", DeprecationWarning)
        try:
            return np.fromstring(text.decode("ascii"), sep=" ") if text.strip() else np.zeros(0)
        except (ValueError, DeprecationWarning):
            return None


def _uniform_rows(block: list[bytes], columns: tuple[int, int, int]) -> np.ndarray | None:
    """Parse lines that all hold the same number of numbers; None when they do not. About ten times faster."""
    width = len(split_line(block[0]))
    if width <= max(columns):
        return None
    text = b" ".join(block)
    # An empty column would shift those after it; quotes may hold separators.
    if b'"' in text or any(pair in text for pair in (b",,", b";;")):
        return None
    decimal = b"," in text and (b";" in text or _has_decimal_commas(next(line for line in block if b"," in line)))
    text = text.translate(bytes.maketrans(b",;\t|", b".   " if decimal else b"    "))
    widths = list(map(len, map(bytes.split, text.split(b"\n"))))
    if not set(widths) <= {0, width}:
        return None
    values = parse_numbers(text)
    if values is None or len(values) != sum(widths):
        return None
    return values.reshape(-1, width)[:, columns]


def _ragged_rows(
    block: list[bytes], columns: tuple[int, int, int], name: str, first_line: int, counted: bool
) -> np.ndarray:
    rows = []
    for number, line in enumerate(block, start=first_line):
        # Microsoft runtimes print NaN as 1.#QNAN; files that were cut to whole blocks end in zeros.
        content = (line if b".#" in line else line.split(b"#", 1)[0]).strip(_BLANK)
        if not content.strip(b",;|") or content.startswith(_COMMENTS):
            continue
        values = split_line(content)
        if counted and len(values) == 1 and values[0].isdigit():
            continue
        try:
            rows.append([_coordinate(values[column]) for column in columns])
        except (IndexError, ValueError):
            raise ScanError(
                f"{name}: line {number} does not hold x, y and z as numbers; mend or remove that line."
            ) from None
    return np.array(rows, dtype=np.float64).reshape(-1, 3)


def _coordinate(token: bytes) -> float:
    """Parse a number, or NaN where there is none."""
    try:
        return number_of(token)
    except ValueError:
        if token.strip().strip(b"\"'").lower() in _MISSING:
            return float("nan")
        raise


def number_of(token: bytes) -> float:
    """Parse one number with a decimal comma, in quotes, or NaN in the words of some runtime.

    Raises:
        ValueError: it is none.
    """
    if len(token) > _MAX_DIGITS or b"_" in token:
        raise ValueError("not a number")
    try:
        return float(token)
    except ValueError:
        # Microsoft runtimes print NaN as -nan(ind), 1.#QNAN or the like.
        if b"nan" in token.lower() or b"#in" in token.lower():
            return float("nan")
        fortran = _FORTRAN.fullmatch(token)
        if fortran is not None:
            return float(fortran[1] + b"e" + fortran[2])
        if _THOUSANDS.fullmatch(token) is not None:
            mark = b"." if b"." in token and token.rfind(b".") < token.rfind(b",") or b"," not in token else b","
            return float(token.replace(mark, b"").replace(b",", b"."))
        return float(token.strip().strip(b"\"'").strip().replace(b",", b"."))


def split_line(line: bytes) -> list[bytes]:
    """Split a line at semicolons, commas (empty columns count), tabs, bars or white space."""
    if len(line) > _MAX_LINE:
        return []
    if b'"' in line:
        text = line.decode("latin-1").strip()
        separator = next((mark for mark in ";\t|" if mark in text), "," if '",' in text or ',"' in text else " ")
        (words,) = csv.reader([text], delimiter=separator, skipinitialspace=True)
        return [word.strip().encode("latin-1") for word in words]
    if b"," in line and b";" not in line and b"." not in line:
        columns = [column.strip() for column in line.strip().rstrip(b",").split(b", ")]
        if len(columns) >= 3 and all(map(_DECIMAL_COMMA.fullmatch, columns)):
            return columns
        if _has_decimal_commas(line):
            return line.replace(b"|", b" ").split()
    for separator_byte in (b";", b",", b"|"):
        if separator_byte in line:
            return [column.strip() for column in line.strip().rstrip(separator_byte).split(separator_byte)]
    return line.split()


def _has_decimal_commas(line: bytes) -> bool:
    """Test whether a line has three words or more, and its commas are decimal ones such as 1,5."""
    words = line.split()
    commas = [word for word in words if b"," in word]
    return (
        len(words) >= 3
        and bool(commas)
        and b"." not in line
        and all(_DECIMAL_COMMA.fullmatch(word) is not None for word in commas)
    )
