"""Points of PLY files: ascii, binary little-endian and binary big-endian."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import islice
from pathlib import Path

import numpy as np

from kpred.errors import ScanError
from kpred.shapes.records import binary_records, text_records, truncated

_TYPES = {
    **{"char": "i1", "uchar": "u1", "short": "i2", "ushort": "u2", "int": "i4", "uint": "u4"},
    **{"float": "f4", "double": "f8", "int8": "i1", "uint8": "u1", "int16": "i2", "uint16": "u2"},
    **{"int32": "i4", "uint32": "u4", "float32": "f4", "float64": "f8"},
}
_ORDERS = {"ascii": "", "binary_little_endian": "<", "binary_big_endian": ">"}


@dataclass
class PlyElement:
    """One ``element`` of the header: its properties as (name, numpy type), None for the type of a list."""

    name: str
    count: int
    properties: list[tuple[str, str | None]]

    def dtype(self, order: str) -> np.dtype | None:
        """Type of one binary record; None when its size varies."""
        if any(kind is None for _, kind in self.properties):
            return None
        return np.dtype([(name, f"{order}{kind}") for name, kind in self.properties])


@dataclass
class PlyHeader:
    """What a PLY file holds, and where in bytes its data starts; order is "", "<" or ">"."""

    order: str
    elements: list[PlyElement]
    start: int
    lines: int

    def count(self, *names: str) -> int:
        """How many of these elements the file has."""
        return sum(element.count for element in self.elements if element.name in names)


def read_ply_header(path: Path) -> PlyHeader:
    """Read the header of a PLY file.

    Raises:
        ScanError: it is not a PLY file or its header is damaged.
    """
    order: str | None = None
    elements: list[PlyElement] = []
    damaged = ScanError(f"{path}: its PLY header is damaged or cut short; export the scan again.")
    with open(path, "rb") as stream:
        if stream.readline(256).strip() != b"ply":
            raise ScanError(f"{path}: it is not a PLY file; give the right extension or export the scan again.")
        for number in range(2, 4096):
            words = stream.readline(4096).decode("latin-1").split()
            try:
                if not words and number > 1000:
                    raise damaged
                if words[:1] == ["format"]:
                    order = _ORDERS[words[1]]
                elif words[:1] == ["element"]:
                    elements.append(PlyElement(words[1], int(words[2]), []))
                elif words[:2] == ["property", "list"]:
                    elements[-1].properties.append((words[4], None))
                elif words[:1] == ["property"]:
                    elements[-1].properties.append((words[2], _TYPES[words[1]]))
                elif words == ["end_header"]:
                    if order is None:
                        raise damaged
                    return PlyHeader(order, elements, stream.tell(), number)
            except (IndexError, KeyError, ValueError):
                raise damaged from None
    raise damaged


def ply_points(path: Path, header: PlyHeader) -> Iterator[np.ndarray]:
    """Yield (n, 3) float64 blocks of the vertices of a PLY file; other properties are ignored.

    Raises:
        ScanError: no vertices with x, y and z, or the file is cut short.
    """
    at = next((i for i, element in enumerate(header.elements) if element.name == "vertex"), None)
    names = [] if at is None else [name for name, _ in header.elements[at].properties]
    if at is None or not header.elements[at].count or not {"x", "y", "z"} <= set(names):
        raise ScanError(f"{path}: it has no vertices with x, y and z; give a scan with at least 64 points.")
    vertex = header.elements[at]
    before = header.elements[:at]
    with open(path, "rb") as stream:
        stream.seek(header.start)
        if header.order == "":
            skipped = sum(element.count for element in before)
            lines = islice(stream, skipped, skipped + vertex.count)
            columns = (names.index("x"), names.index("y"), names.index("z"))
            found = 0
            for rows in text_records(lines, columns, str(path), header.lines + skipped + 1):
                found += len(rows)
                yield rows
            if found < vertex.count:
                raise truncated(str(path), found, vertex.count)
            return
        dtypes = [element.dtype(header.order) for element in [*before, vertex]]
        fixed = [dtype for dtype in dtypes if dtype is not None]
        if len(fixed) < len(dtypes):
            raise ScanError(f"{path}: lists stand before its points; export the PLY with x, y, z vertices first.")
        skipped = sum(dtype.itemsize * element.count for dtype, element in zip(fixed, before, strict=False))
        stream.seek(skipped, 1)
        yield from binary_records(stream, fixed[-1], vertex.count, str(path))
