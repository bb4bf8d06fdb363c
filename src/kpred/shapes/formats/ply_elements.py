"""Whole elements of PLY files, text and binary, lists of any lengths included."""

from __future__ import annotations

import struct
from array import array
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from kpred.errors import ScanError
from kpred.shapes.formats.ply_header import PlyElement, PlyHeader, PlyProperty
from kpred.shapes.formats.records import parse_numbers

_CODES = {
    "i1": "b",
    "u1": "B",
    "i2": "h",
    "u2": "H",
    "i4": "i",
    "u4": "I",
    "i8": "q",
    "u8": "Q",
    "f2": "e",
    "f4": "f",
    "f8": "d",
}


@dataclass(frozen=True, eq=False)
class PlyLists:
    """A list property of N records: (sum of sizes,) values one after the other, (N,) int64 sizes."""

    values: np.ndarray
    sizes: np.ndarray


Columns = dict[str, np.ndarray | PlyLists]
"""Properties of one element by name: (N,) arrays, or lists."""


def read_ply_elements(path: Path, header: PlyHeader) -> dict[str, Columns]:
    """Read every property of every element; of elements with the same name, the first.

    Text gives float64, binary the types of the header. Bytes behind the last element are ignored.

    Raises:
        ScanError: the file is cut short, or a line has another number of values than its properties.
    """
    data = path.read_bytes()[header.start :]
    found: dict[str, Columns] = {}
    if header.order == "":
        for element, columns in zip(header.elements, _text_elements(path, header, data), strict=True):
            found.setdefault(element.name, columns)
        return found
    at = 0
    for element in header.elements:
        columns, at = _binary_element(path, element, header.order, data, at)
        found.setdefault(element.name, columns)
    return found


def _short(path: Path, element: PlyElement) -> ScanError:
    return ScanError(f"{path}: the file is cut short in its {element.count} {element.name} records; copy it again.")


# ---- binary


def _binary_element(path: Path, element: PlyElement, order: str, data: bytes, at: int) -> tuple[Columns, int]:
    if element.count * element.least_size() > len(data) - at:
        raise _short(path, element)
    if not element.has_lists or not element.count:
        rows = np.frombuffer(data, element.dtype(order), element.count, at) if not element.has_lists else None
        columns: Columns = {}
        for item in element.properties:
            if rows is not None:
                columns[item.name] = rows[item.name].astype(item.kind)
            else:
                columns[item.name] = PlyLists(np.zeros(0, item.kind), np.zeros(0, np.int64))
        return columns, at + (0 if rows is None else rows.nbytes)
    same = _equal_lists(element, order, data, at)
    if same is not None:
        return same
    try:
        return _ragged(element, order, data, at)
    except struct.error:
        raise _short(path, element) from None


def _equal_lists(element: PlyElement, order: str, data: bytes, at: int) -> tuple[Columns, int] | None:
    """Read records whose lists all have the lengths of the first, quickly; None if they do not."""
    fields: list[tuple[str, str] | tuple[str, str, tuple[int]]] = []
    place = at
    for number, item in enumerate(element.properties):
        if item.length is not None:
            length_type = np.dtype(f"{order}{item.length}")
            if place + length_type.itemsize > len(data):
                return None
            size = int(np.frombuffer(data, length_type, 1, place)[0])
            if not 0 <= size <= len(data):
                return None
            fields += [(f"length {number}", length_type.str), (f"value {number}", f"{order}{item.kind}", (size,))]
            place += length_type.itemsize + size * np.dtype(item.kind).itemsize
        else:
            fields.append((f"value {number}", f"{order}{item.kind}"))
            place += np.dtype(item.kind).itemsize
    dtype = np.dtype(fields)
    if at + dtype.itemsize * element.count > len(data):
        return None
    rows = np.frombuffer(data, dtype, element.count, at)
    columns: Columns = {}
    for number, item in enumerate(element.properties):
        values = rows[f"value {number}"].astype(item.kind)
        if item.length is None:
            columns[item.name] = values
            continue
        lengths = rows[f"length {number}"]
        if (lengths != lengths[0]).any():
            return None
        columns[item.name] = PlyLists(values.reshape(-1), lengths.astype(np.int64))
    return columns, at + rows.nbytes


def _ragged(element: PlyElement, order: str, data: bytes, at: int) -> tuple[Columns, int]:
    """Read records with lists of different lengths, one by one."""
    places = [array("q") for _ in element.properties]
    sizes = [array("q") for _ in element.properties]
    steps = [
        (struct.Struct(order + _CODES[item.length or item.kind]), np.dtype(item.kind).itemsize, item.length is not None)
        for item in element.properties
    ]
    place, end = at, len(data)
    for _ in range(element.count):
        for number, (reader, width, is_list) in enumerate(steps):
            if not is_list:
                places[number].append(place)
                place += width
                continue
            size = int(reader.unpack_from(data, place)[0])
            place += reader.size
            if size < 0:
                raise struct.error("a negative length")
            places[number].append(place)
            sizes[number].append(size)
            place += size * width
        if place > end:
            raise struct.error("cut short")
    raw = np.frombuffer(data, np.uint8)
    columns: Columns = {}
    for number, item in enumerate(element.properties):
        starts = np.array(places[number], dtype=np.int64)
        if item.length is None:
            columns[item.name] = _gathered(raw, starts, item, order)
            continue
        lengths = np.array(sizes[number], dtype=np.int64)
        width = np.dtype(item.kind).itemsize
        first = np.cumsum(lengths) - lengths
        within = np.arange(int(lengths.sum())) - np.repeat(first, lengths)
        columns[item.name] = PlyLists(_gathered(raw, np.repeat(starts, lengths) + within * width, item, order), lengths)
    return columns, place


def _gathered(raw: np.ndarray, starts: np.ndarray, item: PlyProperty, order: str) -> np.ndarray:
    """Gather values (N,) that begin at these bytes."""
    width = np.dtype(item.kind).itemsize
    taken = raw[starts[:, None] + np.arange(width)]
    return np.ascontiguousarray(taken).view(f"{order}{item.kind}").reshape(-1).astype(item.kind)


# ---- text


def _text_elements(path: Path, header: PlyHeader, data: bytes) -> list[Columns]:
    text = data.replace(b"\r", b"\n") if b"\r" in data else data
    lines = [line for line in text.split(b"\n") if line.strip()]
    at, found = 0, []
    for element in header.elements:
        rows = lines[at : at + element.count] if element.properties else []
        at += len(rows)
        if len(rows) < (element.count if element.properties else 0):
            raise _short(path, element)
        values = parse_numbers(b"\n".join(rows))
        if values is None:
            raise ScanError(f"{path}: a line of its {element.name} records does not hold numbers; export it again.")
        found.append(_text_columns(path, element, values, rows))
    return found


def _text_columns(path: Path, element: PlyElement, values: np.ndarray, rows: list[bytes]) -> Columns:
    wrong = ScanError(
        f"{path}: its {element.name} records do not hold the values that the header names (damaged or cut short); "
        "export it again."
    )
    if not element.has_lists:
        width = len(element.properties)
        found = len(values) // max(len(rows), 1)
        # Further values at the end of every line are ignored.
        if rows and (found < width or len(values) != found * len(rows) or len(rows[0].split()) != found):
            raise wrong
        table = values.reshape(len(rows), found) if rows else np.zeros((0, width))
        return {item.name: table[:, number].copy() for number, item in enumerate(element.properties)}
    same = _equal_text_lists(element, values, len(rows))
    if same is not None:
        return same
    taken = [array("d") for _ in element.properties]
    sizes = [array("q") for _ in element.properties]
    numbers, at, end = array("d", values.tobytes()), 0, len(values)
    for _ in rows:
        for number, item in enumerate(element.properties):
            if at >= end:
                raise wrong
            if item.length is None:
                taken[number].append(numbers[at])
                at += 1
                continue
            length = numbers[at]
            if not 0 <= length <= end - at - 1 or length != int(length):
                raise wrong
            sizes[number].append(int(length))
            taken[number] += numbers[at + 1 : at + 1 + int(length)]
            at += 1 + int(length)
    if at != end:
        raise wrong
    return {
        item.name: np.array(taken[number])
        if item.length is None
        else PlyLists(np.array(taken[number]), np.array(sizes[number], dtype=np.int64))
        for number, item in enumerate(element.properties)
    }


def _equal_text_lists(element: PlyElement, values: np.ndarray, count: int) -> Columns | None:
    """Read text records whose lists all have the lengths of the first; None if they do not."""
    if not count or len(values) % count:
        return None
    table, at = values.reshape(count, -1), 0
    columns: Columns = {}
    for item in element.properties:
        if at >= table.shape[1]:
            return None
        if item.length is None:
            columns[item.name] = table[:, at].copy()
            at += 1
            continue
        length = table[0, at]
        if not 0 <= length <= table.shape[1] - at - 1 or (table[:, at] != length).any() or length != int(length):
            return None
        inside = table[:, at + 1 : at + 1 + int(length)]
        columns[item.name] = PlyLists(inside.reshape(-1), np.full(count, int(length), dtype=np.int64))
        at += 1 + int(length)
    return columns if at == table.shape[1] else None
