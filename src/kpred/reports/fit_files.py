"""All files of a fit, written together: mesh, record, picture, page."""

from __future__ import annotations

import shutil
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np

from kpred.atomic import write_together
from kpred.exports.furniture import WOOD
from kpred.fitting import Fit
from kpred.fitting.export import result_writers
from kpred.json_output import json_text
from kpred.rendering.picture import save_picture
from kpred.reports.fit_report import fit_report


@dataclass(frozen=True)
class Written:
    """What was written: the files, the mesh first, and the record of the fit."""

    files: list[Path]
    record: dict[str, Any]


def write_files(
    fit: Fit,
    scan: np.ndarray,
    path: Path,
    *,
    scan_path: Path,
    shown: str = "",
    picture: bool = True,
    density: float = WOOD,
    report: Path | None = None,
    more: Mapping[Path, Callable[[Path], object]] | None = None,
) -> Written:
    """Write the mesh `path` and, beside it, the record and the picture: all of them or none, `more` included.

    Args:
        scan: (N, 3) in its own frame; scan_path: its file; shown: what the report calls it, by default its name.
        density: of furniture in simulations, kg per cubic metre; by default that of wood.
        report: page to write too; more: further files with what writes them (`kpred.atomic.write_together`).

    Raises:
        OutputError: a file cannot be written there.
    """
    record = {**fit.record(), "scan": scan_path, "mesh": path}
    text = json_text(record)
    with TemporaryDirectory(prefix="kpred-") as folder:
        scratch = Path(folder) / "picture.png"
        writers: dict[Path, Callable[[Path], object]] = {
            **result_writers(fit, path, density),
            path.with_suffix(".json"): lambda file: file.write_text(text, encoding="utf-8"),
        }
        drawn = scratch if picture and save_picture(fit, scan, scratch) else None
        if drawn is not None:
            writers[path.with_suffix(".png")] = lambda file: shutil.copyfile(scratch, file)
        if report is not None:
            page = fit_report(fit, scan, shown or scan_path.name, drawn)
            writers[report] = lambda file: file.write_text(page, encoding="utf-8")
        writers |= more or {}
        write_together(writers)
    return Written(list(writers), record)
