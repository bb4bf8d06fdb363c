"""The header of PLY files: which elements they hold, of which properties, and where the data starts."""

from __future__ import annotations

import re
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from kpred.errors import ScanError

_TYPES = {
    **{"char": "i1", "uchar": "u1", "short": "i2", "ushort": "u2", "int": "i4", "uint": "u4"},
    **{"float": "f4", "double": "f8", "int8": "i1", "uint8": "u1", "int16": "i2", "uint16": "u2"},
    **{"int32": "i4", "uint32": "u4", "float32": "f4", "float64": "f8", "int64": "i8", "uint64": "u8", "long": "i4"},
    **{"half": "f2", "float16": "f2", "f16": "f2", "f32": "f4", "f64": "f8", "bool": "u1"},
}
_ORDERS = {"ascii": "", "binary_little_endian": "<", "binary_big_endian": ">"}
_ALIASES = {"vertices": "vertex", "point": "vertex", "points": "vertex", "faces": "face"}
"""Names that some programs give to elements."""

_MAX_HEADER = 1 << 20
_END = re.compile(rb"(?:^|[\r\n])end_header[ \t]*(\r\n|\n|\r|$)")


@dataclass(frozen=True)
class PlyProperty:
    """One ``property``: its name in lower case, numpy type, and for lists the numpy type of their length."""

    name: str
    kind: str
    length: str | None = None


@dataclass(frozen=True)
class PlyElement:
    """One ``element`` of the header; names are in lower case and unique."""

    name: str
    count: int
    properties: tuple[PlyProperty, ...]

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the properties."""
        return tuple(item.name for item in self.properties)

    @property
    def has_lists(self) -> bool:
        """Whether records differ in size."""
        return any(item.length is not None for item in self.properties)

    def dtype(self, order: str) -> np.dtype:
        """Return the type of one binary record without lists; order is "<" or ">"."""
        return np.dtype([(item.name, f"{order}{item.kind}") for item in self.properties])

    def least_size(self) -> int:
        """Return the bytes of the smallest binary record, with empty lists."""
        return sum(np.dtype(item.length or item.kind).itemsize for item in self.properties)


@dataclass(frozen=True)
class PlyHeader:
    """What a PLY file holds, and where its data starts.

    Attributes:
        order: "" for ascii, "<" or ">" for binary.
        start: of the data, in bytes; lines: of the header; lone_returns: lines end in a carriage return alone.
    """

    order: str
    elements: tuple[PlyElement, ...]
    start: int
    lines: int
    lone_returns: bool = False

    def count(self, *names: str) -> int:
        """Return the number of elements of this name."""
        return sum(element.count for element in self.elements if element.name in names)

    def element(self, name: str) -> PlyElement | None:
        """Return the first element of this name."""
        return next((element for element in self.elements if element.name == name), None)


def read_ply_header(path: Path) -> PlyHeader:
    """Read the header of a PLY file.

    Raises:
        ScanError: it is not a PLY file or its header is damaged.
    """
    with open(path, "rb") as stream:
        data = stream.read(_MAX_HEADER)
    mark = 3 if data.startswith(b"\xef\xbb\xbf") else 0
    if data[mark : mark + 3].lower() != b"ply" or data[mark + 3 : mark + 4] not in (b"\r", b"\n", b" "):
        raise ScanError(f"{path}: it is not a PLY file; give the right extension or export the scan again.")
    end = _END.search(data, mark)
    try:
        if end is None:
            raise ValueError("no end_header")
        text = data[mark : end.start()].decode("latin-1")
        order, elements = _parsed(text.splitlines())
    except _UnknownTypeError as error:
        raise ScanError(f"{path}: its PLY header names the unknown type {error}; export it with floats.") from None
    except (IndexError, KeyError, ValueError):
        raise ScanError(f"{path}: its PLY header is damaged or cut short; export the scan again.") from None
    lone = end.group(1) == b"\r"
    # Where lines end in "\r\n", a last "\r\n" is one end of line; where they end in "\r", the "\n" is data.
    after = end.start(1) + 1 if end.group(1) == b"\r\n" and "\n" not in text else end.end()
    return PlyHeader(order, elements, after, len(text.splitlines()) + 1, lone or (order == "" and "\n" not in text))


class _UnknownTypeError(Exception):
    """A property is of a type that PLY does not have."""


def _type(word: str) -> str:
    found = _TYPES.get(word.lower())
    if found is None:
        raise _UnknownTypeError(repr(word[:20]))
    return found


def _parsed(lines: list[str]) -> tuple[str, tuple[PlyElement, ...]]:
    order = ""
    known = False
    found: list[tuple[str, int, list[PlyProperty]]] = []
    for line in lines:
        words = line.split()
        keyword = words[0].lower() if words else ""
        if keyword == "format":
            order, known = _ORDERS[words[1].lower()], True
        elif keyword == "element":
            count = int(words[2])
            if count < 0:
                raise ValueError("a negative count")
            found.append((_ALIASES.get(words[1].lower(), words[1].lower()), count, []))
        elif keyword == "property" and words[1].lower() == "list":
            found[-1][2].append(PlyProperty(words[4].lower(), _type(words[3]), _type(words[2])))
        elif keyword == "property":
            found[-1][2].append(PlyProperty(words[2].lower(), _type(words[1])))
    if not known:
        raise ValueError("no format")
    return order, tuple(PlyElement(name, count, _unique(items)) for name, count, items in found)


def _unique(properties: list[PlyProperty]) -> tuple[PlyProperty, ...]:
    """Make the names of properties unique by numbers after a blank, which no name can hold."""
    names = [item.name for item in properties]
    return tuple(
        PlyProperty(f"{item.name} {number}" if item.name in names[:number] else item.name, item.kind, item.length)
        for number, item in enumerate(properties)
    )
