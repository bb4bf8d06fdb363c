"""Parquet manifests: tables that name very many scans or meshes, one a row.

Columns: `path` (a file, relative to the manifest's folder unless it is absolute); optional `id` and `category`, and for
meshes `split`. Other columns are left alone. Rows are read part by part, so that a manifest may be of any length.
"""

from __future__ import annotations

import os
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from kpred.errors import KpredError, ManifestError
from kpred.shapes.reading import check_file

_PART = 8192


@dataclass(frozen=True)
class ManifestRow:
    """One row; `problem` is a sentence when it cannot be used, else empty.

    Attributes:
        number: of the row, from 0; name: its id, or its path as it is written there.
        path: the file, which has not been looked at; None where the row names none.
        category, split: as written; None where the manifest does not say.
    """

    number: int
    name: str
    path: Path | None
    category: str | None = None
    split: str | None = None
    problem: str = ""


def read_manifest(path: str | os.PathLike[str]) -> Iterator[ManifestRow]:
    """The rows of a Parquet file, broken ones included.

    Raises:
        ManifestError: no such file, no whole Parquet file, no column `path` of text, or pyarrow is not installed.
    """
    try:
        from pyarrow import parquet
    except ImportError as error:
        raise ManifestError(f"{path}: Parquet files need pyarrow; pip install 'kpred[parquet]'.") from error
    file = Path(path)
    check_file(file, ManifestError, "Parquet manifest")
    try:
        table = parquet.ParquetFile(file)
        names = set(table.schema_arrow.names)
        if "path" not in names:
            raise ManifestError(
                f"{file}: it has no column 'path'; its columns are {', '.join(sorted(names)) or 'none'}."
            )
        columns = [name for name in ("path", "id", "category", "split") if name in names]
        number = 0
        for part in table.iter_batches(_PART, columns=columns):
            for row in part.to_pylist():
                yield _row(row, number, file)
                number += 1
    except (KpredError, GeneratorExit):
        raise
    except Exception as error:  # The parser of foreign bytes may fail in any way.
        reason = (str(error).splitlines() or [type(error).__name__])[0][:200]
        raise ManifestError(f"{file}: it is no whole Parquet file ({reason}); write it again.") from error


def _row(row: dict[str, Any], number: int, file: Path) -> ManifestRow:
    written, given = row.get("path"), row.get("id")
    name = str(given) if given not in (None, "") else str(written or f"row {number}")
    if not isinstance(written, str) or not written.strip():
        return ManifestRow(number, name, None, problem=f"row {number} of {file.name} names no file")
    if "\0" in written:
        return ManifestRow(number, name, None, problem=f"row {number} of {file.name} names no possible file")
    category, split = (str(row[key]) if row.get(key) else None for key in ("category", "split"))
    return ManifestRow(number, name, file.parent / written, category, split)
