"""The files of a fit (mesh, record, picture) and what is printed about it; shared by `fit` and `demo`."""

from __future__ import annotations

import json
import shutil
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np

from kpred.cli.output import Output
from kpred.errors import OutputError
from kpred.fitting import Fit
from kpred.json_output import json_text


def check_output(
    path: Path, scan: Path, overwrite: bool = False, picture: bool = True, more: Sequence[Path] = ()
) -> None:
    """Refuse an output file before any work is done for it.

    Args:
        overwrite: files beside the mesh may be replaced even if kpred did not make them.
        picture: whether one will be written; more: further files that will be.

    Raises:
        OutputError: unknown extension, a place that cannot be written, a file of the fit would overwrite the scan, or
            one beside the mesh would overwrite what is no file of a fit.
    """
    from kpred.atomic import check_place
    from kpred.exports import check_extension

    check_extension(path)
    for file in _files(path):
        check_place(file)
    if any(file.exists() and scan.exists() and file.samefile(scan) for file in _files(path)):
        raise OutputError(f"Cannot write {path}: it would overwrite the scan {scan}; choose another name.")
    if not overwrite:
        beside = [path.with_suffix(".mtl")] if path.suffix.lower() == ".obj" else []
        check_foreign(path.with_suffix(".json"), [*_files(path)[1 : 3 if picture else 2], *beside, *more])


def default_output(scan: Path) -> Path:
    """Return where the result of a scan is written if the user does not say: SCAN_fitted.glb in this folder."""
    return Path(f"{scan.stem}_fitted.glb")


def check_foreign(record: Path, files: Sequence[Path]) -> None:
    """Refuse to replace files beside the one that the user named, unless the record there says that kpred made them.

    Raises:
        OutputError: a file is there, and `record` is no record of kpred.
    """
    there = next((file for file in files if file.exists()), None)
    if there is not None and not _is_record(record):
        raise OutputError(
            f"Cannot write {there}: it is there, and kpred did not make it; give --overwrite or another name."
        )


def _is_record(file: Path) -> bool:
    try:
        content = json.loads(file.read_text(encoding="utf-8"))
    except (OSError, ValueError, RecursionError):
        return False
    return isinstance(content, dict) and "kpred" in content


def write_files(
    fit: Fit,
    scan: np.ndarray,
    path: Path,
    *,
    scan_path: Path,
    picture: bool = True,
    density: float | None = None,
    report: Path | None = None,
    more: Mapping[Path, Callable[[Path], object]] | None = None,
) -> list[Path]:
    """Write the mesh `path` and, beside it, the record and the picture; return what was written, the mesh first.

    All of them or none, `more` included: files with what writes them (`kpred.atomic.write_together`).
    `density`: of furniture in simulations, kg per cubic metre; by default that of wood. `report`: page to write, too.

    Raises:
        OutputError: a file cannot be written there.
    """
    from kpred.atomic import write_together
    from kpred.exports.furniture import WOOD
    from kpred.fitting.export import result_writers
    from kpred.reports.fit_report import fit_report

    mesh_file, record_file, picture_file = _files(path)
    record = {**fit.record(), "scan": scan_path, "mesh": mesh_file}
    text = json_text(record)
    with TemporaryDirectory(prefix="kpred-") as folder:
        scratch = Path(folder) / "picture.png"
        writers: dict[Path, Callable[[Path], object]] = {
            **result_writers(fit, mesh_file, WOOD if density is None else density),
            record_file: lambda file: file.write_text(text, encoding="utf-8"),
        }
        drawn = scratch if picture and _drawn(fit, scan, scratch) else None
        if drawn is not None:
            writers[picture_file] = lambda file: shutil.copyfile(scratch, file)
        if report is not None:
            page = fit_report(fit, scan, scan_path.name, drawn)
            writers[report] = lambda file: file.write_text(page, encoding="utf-8")
        writers |= more or {}
        write_together(writers)
    return list(writers)


def _drawn(fit: Fit, scan: np.ndarray, file: Path) -> bool:
    from kpred.rendering.picture import save_picture

    return save_picture(fit, scan, file)


def describe(output: Output, fit: Fit, files: list[Path]) -> None:
    """Print what was chosen, how sure that is, what was changed, how well it fits, and which files were written."""
    output.result({**fit.to_json(), "files": files})
    several = len(fit.category_confidence) > 1
    factor, cleanliness = float(fit.placement.scale.max()), fit.cleanliness
    size = " x ".join(f"{side:.3g}" for side in np.ptp(fit.mesh.bounds, axis=0))
    rows: list[tuple[str, Any, str, str]] = [
        ("model", fit.source.model_id, "", ""),
        ("category", fit.category, "", ""),
        *([("category confidence", fit.category_confidence[fit.category], "probability", "")] if several else []),
        ("confidence", fit.confidence, "probability", ""),
        ("surface seen", fit.seen, "fraction", ""),
        ("models compared", len(fit.candidates), "", ""),
        ("change", fit.source.step, f"of --deform {fit.deform}", ""),
        ("own size of the model", "kept" if fit.placement.own_size else f"x {factor:.3g}", "", ""),
        ("right angles changed by", cleanliness.squareness, "degrees, mean", ""),
        ("flat faces bent by", 100 * cleanliness.flatness, "% of the longest side", ""),
        ("triangles", len(fit.mesh.faces), "", ""),
        ("size", size, fit.unit.name if fit.unit.origin != "assumed" else "scan units", "scan"),
        *((metric.name.replace("_", " "), metric.value, metric.unit, metric.frame) for metric in fit.metrics),
        ("time", f"{1000 * sum(fit.timings.values()):.0f}", "ms", ""),
    ]
    output.table("fit", ["", "value", "unit", "frame"], rows)
    for file in files:
        output.note(f"wrote {file}")
    for sentence in fit.warnings:
        output.caution(sentence)


def _files(path: Path) -> tuple[Path, Path, Path]:
    return path, path.with_suffix(".json"), path.with_suffix(".png")
