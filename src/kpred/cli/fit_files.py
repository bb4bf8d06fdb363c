"""Where the files of a fit go, and what is printed about it; it loads no networks."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from kpred.cli.output import Output
from kpred.errors import OutputError


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
    from kpred.exports.format_table import check_extension

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


def describe(output: Output, record: Mapping[str, Any], files: Sequence[Path]) -> None:
    """Print what was chosen, how sure that is, what was changed, how well it fits, and which files were written.

    Args:
        record: of the fit (docs/record.schema.json).
    """
    output.result({**record, "files": files})
    several = len(record["category_confidence"]) > 1
    placement, cleanliness, category = record["model_to_scan"], record["cleanliness"], record["category"]
    unit = record["unit"]
    rows: list[tuple[str, Any, str, str]] = [
        ("model", record["model_id"], "", ""),
        ("category", category, "", ""),
        *([("category confidence", record["category_confidence"][category], "probability", "")] if several else []),
        ("confidence", record["confidence"], "probability", ""),
        ("surface seen", record["seen"], "fraction", ""),
        ("models compared", len(record["candidates"]), "", ""),
        ("change", record["step"], f"of --deform {record['deform']}", ""),
        ("own size of the model", "kept" if placement["own_size"] else f"x {max(placement['scale']):.3g}", "", ""),
        ("right angles changed by", cleanliness["squareness"], "degrees, mean", ""),
        ("flat faces bent by", 100 * cleanliness["flatness"], "% of the longest side", ""),
        ("triangles", record["triangles"], "", ""),
        (
            "size",
            " x ".join(f"{side:.3g}" for side in record["size"]),
            unit["name"] if unit["origin"] != "assumed" else "scan units",
            "scan",
        ),
        *((one["name"].replace("_", " "), one["value"], one["unit"], one["frame"]) for one in record["metrics"]),
        ("time", f"{1000 * sum(record['timings_seconds'].values()):.0f}", "ms", ""),
    ]
    output.table("fit", ["", "value", "unit", "frame"], rows)
    for file in files:
        output.note(f"wrote {file}")
    for sentence in record["warnings"]:
        output.caution(sentence)


def _files(path: Path) -> tuple[Path, Path, Path]:
    return path, path.with_suffix(".json"), path.with_suffix(".png")
