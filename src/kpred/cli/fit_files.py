"""The files of a fit (mesh, record, picture) and what is printed about it; shared by `fit` and `demo`."""

from __future__ import annotations

import json
import shutil
from contextlib import ExitStack
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np

from kpred import __version__
from kpred.cli.output import Output, plain
from kpred.errors import OutputError
from kpred.fitting import Fit


def check_output(path: Path, scan: Path) -> None:
    """Refuse an output file before any work is done for it.

    Raises:
        OutputError: unknown extension, a place that cannot be written, or a file of the fit would overwrite the scan.
    """
    from kpred.shapes.atomic import check_place
    from kpred.shapes.mesh_io import OUTPUT_EXTENSIONS

    if path.suffix.lower() not in OUTPUT_EXTENSIONS:
        known = ", ".join(OUTPUT_EXTENSIONS)
        raise OutputError(f"Cannot write {path}: unknown extension {path.suffix!r}; use one of {known}.")
    for file in _files(path):
        check_place(file)
    if any(file.exists() and scan.exists() and file.samefile(scan) for file in _files(path)):
        raise OutputError(f"Cannot write {path}: it would overwrite the scan {scan}; choose another name.")


def write_files(fit: Fit, scan: np.ndarray, path: Path, *, scan_path: Path, picture: bool = True) -> list[Path]:
    """Write the mesh `path` and, beside it, the record and the picture; return what was written, the mesh first.

    All of them or none: each waits under a temporary name until the others have been written.

    Raises:
        OutputError: a file cannot be written there.
    """
    from kpred.shapes import write_mesh
    from kpred.shapes.atomic import atomic_path

    mesh_file, record_file, picture_file = _files(path)
    record = {"kpred": __version__, "scan": scan_path, "mesh": mesh_file, **fit.to_json()}
    with ExitStack() as all_or_none:
        scratch = Path(all_or_none.enter_context(TemporaryDirectory(prefix="kpred-"))) / "picture.png"
        with_picture = picture and _drawn(fit, scan, scratch)
        temporary = all_or_none.enter_context(atomic_path(record_file))
        temporary.write_text(json.dumps(plain(record), indent=2, allow_nan=False) + "\n", encoding="utf-8")
        if with_picture:
            temporary = all_or_none.enter_context(atomic_path(picture_file))
            shutil.copyfile(scratch, temporary)
        write_mesh(mesh_file, fit.mesh)
    return [mesh_file, record_file, picture_file] if with_picture else [mesh_file, record_file]


def _drawn(fit: Fit, scan: np.ndarray, file: Path) -> bool:
    from kpred.fitting.picture import save_picture

    return save_picture(fit, scan, file)


def describe(output: Output, fit: Fit, files: list[Path]) -> None:
    """Print what was chosen, how well it fits, how long it took and which files were written."""
    output.result({**fit.to_json(), "files": files})
    size = " x ".join(f"{side:.3g}" for side in np.ptp(fit.mesh.bounds, axis=0))
    rows: list[tuple[str, Any, str, str]] = [
        ("model", fit.source.model_id, "", ""),
        ("category", fit.category, "", ""),
        ("scan taken as", "partial" if fit.partial else "full", "", ""),
        ("models compared", len(fit.candidates), "", ""),
        ("triangles", len(fit.mesh.faces), "", ""),
        ("size", size, "scan units", "scan"),
        *((metric.name.replace("_", " "), metric.value, metric.unit, metric.frame) for metric in fit.metrics),
        ("time", f"{1000 * sum(fit.timings.values()):.0f}", "ms", ""),
    ]
    output.table("fit", ["", "value", "unit", "frame"], rows)
    for file in files:
        output.note(f"wrote {file}")


def _files(path: Path) -> tuple[Path, Path, Path]:
    return path, path.with_suffix(".json"), path.with_suffix(".png")
