"""Files of an export, in the format of the suffix."""

from __future__ import annotations

import os
from collections.abc import Callable
from importlib import import_module
from pathlib import Path

import numpy as np

from kpred.atomic import write_together
from kpred.errors import OutputError
from kpred.exports.format_table import check_extension
from kpred.exports.furniture import Export
from kpred.exports.writer import Writer


def export_writers(export: Export, path: str | os.PathLike[str]) -> dict[Path, Writer]:
    """List the files of an export with what writes each: `path` first, then what lies beside it (`STEM_*`).

    Raises:
        OutputError: unknown extension, a library is missing, the format holds one object alone, or a mesh is not
            finite.
        DatabaseError: the model's materials cannot be read.
    """
    file = Path(path)
    found = check_extension(file)
    if len(export.objects) > 1 and not found.rooms:
        raise OutputError(f"Cannot write {file}: {found.name} holds one object; use .glb, .usd, .xml or .ifc.")
    for one in export.objects:
        if not np.isfinite(one.vertices).all():
            raise OutputError(f"Cannot write {file}: the mesh has vertices that are NaN or infinite; fit it again.")
    module = import_module(f"kpred.exports.{found.module}")
    write: Callable[[Export, Path], dict[Path, Writer]] = getattr(module, f"{found.module}_writers")
    return write(export, file)


def save_export(export: Export, path: str | os.PathLike[str]) -> list[Path]:
    """Write the files of an export, all of them or none, and return them.

    Raises:
        OutputError: as `export_writers`, or a file cannot be written there.
    """
    writers = export_writers(export, path)
    write_together(writers)
    return list(writers)
