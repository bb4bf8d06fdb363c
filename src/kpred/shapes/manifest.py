"""Manifests: tables that name scans or meshes, one a row, in Parquet, CSV or JSON.

Columns: `path` (a file, relative to the manifest's folder unless it is absolute); optional `id` and `category`, and for
meshes `split`, `up`, `front` (axes of the file, as `y` or `-z`), `width`, `height`, `depth` (of the model that stands
upright, in metres), `title`, `author`, `licence` and `source`. CSV and JSON (a list of objects) may have any other
columns, which are kept as metadata; those of Parquet, which may be large, are not read. Rows are read part by part.
"""

from __future__ import annotations

import csv
import json
import math
import os
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from kpred.errors import KpredError, ManifestError
from kpred.ops.rotations import UP_AXES
from kpred.shapes.reading import check_file, reading

MANIFEST_NAMES = ("manifest.csv", "manifest.json", "manifest.parquet")
"""Files that describe the meshes of their folder."""

MANIFEST_EXTENSIONS = (".parquet", ".csv", ".json")

SIZES = ("width", "height", "depth")
KNOWN = ("title", "author", "licence", "license", "source", *SIZES)
MAX_LENGTH = 2000
"""Characters of a value that are kept."""

_PART = 8192
_OWN = ("path", "id", "category", "split", "up", "front")


@dataclass(frozen=True)
class ManifestRow:
    """One row; `problem` is a sentence when it cannot be used, else empty.

    Attributes:
        number: of the row, from 0; name: its id, or its path as it is written there.
        path: the file, which has not been looked at; None where the row names none.
        category, split: as written; None where the manifest does not say.
        up, front: axes of the file that become y and +z.
        details: the other columns that are not empty, `license` under the name `licence`.
    """

    number: int
    name: str
    path: Path | None
    category: str | None = None
    split: str | None = None
    problem: str = ""
    up: str = "y"
    front: str = "z"
    details: Mapping[str, str] = field(default_factory=dict)

    def size(self) -> tuple[float, ...] | None:
        """Width, height and depth in metres, where the manifest names all three."""
        if not all(key in self.details for key in SIZES):
            return None
        return tuple(float(self.details[key]) for key in SIZES)


def read_manifest(path: str | os.PathLike[str]) -> Iterator[ManifestRow]:
    """Yield the rows of a manifest, broken ones included.

    Raises:
        ManifestError: no such file, damaged, no column `path` of text, or pyarrow is needed and not installed.
    """
    file = Path(path)
    extension = file.suffix.lower()
    kind = {".csv": "CSV", ".json": "JSON"}.get(extension, "Parquet")
    check_file(file, ManifestError, f"{kind} manifest")
    rows = {".csv": _csv_rows, ".json": _json_rows}.get(extension, _parquet_rows)
    for number, row in enumerate(rows(file)):
        yield _row(row, number, file)


def folder_manifest(folder: Path) -> Path | None:
    """Find the manifest of a folder of meshes; None where it has none."""
    return next((folder / name for name in MANIFEST_NAMES if (folder / name).is_file()), None)


def _parquet_rows(file: Path) -> Iterator[dict[str, Any]]:
    try:
        from pyarrow import parquet
    except ImportError as error:
        raise ManifestError(f"{file}: Parquet files need pyarrow; pip install 'kpred[parquet]'.") from error
    try:
        table = parquet.ParquetFile(file)
        names = set(table.schema_arrow.names)
        _check_columns(names, file)
        columns = [name for name in (*_OWN, *KNOWN) if name in names]
        for part in table.iter_batches(_PART, columns=columns):
            yield from part.to_pylist()
    except (KpredError, GeneratorExit):
        raise
    except Exception as error:  # The parser of foreign bytes may fail in any way.
        reason = (str(error).splitlines() or [type(error).__name__])[0][:200]
        raise ManifestError(f"{file}: it is no whole Parquet file ({reason}); write it again.") from error


def _csv_rows(file: Path) -> Iterator[dict[str, Any]]:
    with reading(file, ManifestError, "CSV manifest"), open(file, encoding="utf-8-sig", newline="") as stream:
        table = csv.DictReader(stream)
        _check_columns(set(table.fieldnames or ()), file)
        for row in table:
            yield {key: value for key, value in row.items() if isinstance(key, str) and isinstance(value, str)}


def _json_rows(file: Path) -> Iterator[dict[str, Any]]:
    with reading(file, ManifestError, "JSON manifest"):
        content = json.loads(file.read_text(encoding="utf-8-sig"))
    if not isinstance(content, list) or not all(isinstance(row, dict) for row in content):
        raise ManifestError(f"{file}: it is no list of objects; write one object a mesh.")
    _check_columns({key for row in content for key in row}, file)
    yield from content


def _check_columns(names: set[str], file: Path) -> None:
    if "path" not in names:
        raise ManifestError(f"{file}: it has no column 'path'; its columns are {', '.join(sorted(names)) or 'none'}.")


def _row(row: dict[str, Any], number: int, file: Path) -> ManifestRow:
    written, given = row.get("path"), row.get("id")
    name = str(given) if given not in (None, "") else str(written or f"row {number}")
    if not isinstance(written, str) or not written.strip():
        return ManifestRow(number, name, None, problem=f"row {number} of {file.name} names no file")
    if "\0" in written:
        return ManifestRow(number, name, None, problem=f"row {number} of {file.name} names no possible file")
    category, split = (str(row[key]) if row.get(key) else None for key in ("category", "split"))
    up, front = (str(row.get(key) or default).strip().lstrip("+") for key, default in (("up", "y"), ("front", "z")))
    details = {
        "licence" if key == "license" else str(key): " ".join(str(value).split())[:MAX_LENGTH]
        for key, value in row.items()
        if key not in _OWN and value not in (None, "")
    }
    problem = _problem(up, front, details)
    where = f"{name} ({file.name}, row {number}): {problem}" if problem else ""
    return ManifestRow(number, name, file.parent / written, category, split, where, up, front, details)


def _problem(up: str, front: str, details: Mapping[str, str]) -> str:
    for key, axis in (("up", up), ("front", front)):
        if axis not in UP_AXES:
            return f"its {key} is {axis[:20]!r}, not one of {', '.join(UP_AXES)}"
    if up[-1] == front[-1]:
        return f"its up ({up}) and its front ({front}) lie along one axis"
    for key in SIZES:
        if key in details and not _is_length(details[key]):
            return f"its {key} is {details[key][:20]!r}, not a length in metres"
    return ""


def _is_length(text: str) -> bool:
    try:
        return 0 < float(text) < math.inf
    except ValueError:
        return False
