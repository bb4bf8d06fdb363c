"""The record of a fit: what it found, and all that is needed to make it again (docs/record.schema.json)."""

from __future__ import annotations

import platform
from dataclasses import asdict
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from kpred._version import __version__
from kpred.database.address import is_address
from kpred.fitting.defaults import bundled_database_path
from kpred.fitting.options import FitOptions
from kpred.fitting.source import mesh_sha256, scan_sha256
from kpred.nn.fingerprint import weights_fingerprint
from kpred.nn.loading import is_folder_name

if TYPE_CHECKING:
    from kpred.fitting.result import Fit

RECORD_VERSION = 1
"""Version of the schema; a change that old readers cannot read raises it."""

LIBRARIES = ("numpy", "torch", "numba", "scipy")
"""Libraries whose versions may change results."""

BUNDLED_DATABASE = "bundled"


def make_record(fit: Fit) -> dict[str, Any]:
    """Return the record of a fit as plain values: `Fit.to_json` and what `kpred refit` needs.

    Raises:
        ScanError: the scan's file is gone. DatabaseError: the database is closed, or cannot be read.
    """
    source = fit.source_data
    database = source.context.database
    model = source.context.model
    file = source.file
    return {
        "kpred": __version__,
        "record_version": RECORD_VERSION,
        **fit.to_json(),
        "input": {
            "path": None if file is None else str(file),
            "sha256": None if file is None else scan_sha256(file),
            "points": source.points,
            "points_sha256": source.points_sha256,
        },
        "database": {"path": _database_path(database.path), "fingerprint": database.fingerprint()},
        "weights": {"model": _model_name(model.name), "fingerprint": weights_fingerprint(model)},
        "options": {"categories": list(source.context.categories), **options_to_json(source.options)},
        "versions": versions(),
        "deformation": _deformation(fit),
        "licence": fit.details.get("licence", ""),
        "mesh_sha256": mesh_sha256(np.asarray(fit.mesh.vertices), np.asarray(fit.mesh.faces)),
    }


def options_to_json(options: FitOptions) -> dict[str, Any]:
    """Return all options as plain values; an estimator that is no name becomes a description in angle brackets."""
    pose = options.pose
    return {
        "top_k": options.top_k,
        "frame": options.frame,
        "deform": options.deform,
        "partial": options.partial,
        "up": options.up,
        "pose": pose if pose is None or isinstance(pose, str) else f"<{type(pose).__name__}>",
        "clean": options.clean if isinstance(options.clean, bool) else asdict(options.clean),
        "seed": options.seed,
        "model_id": options.model_id,
        "refinement": asdict(options.refinement),
        "structure": asdict(options.structure),
        "sensors": None if options.sensors is None else np.asarray(options.sensors).tolist(),
        "floor": options.floor,
        "unit": options.unit,
    }


def versions() -> dict[str, str]:
    """Return the versions of kpred, Python and the libraries that numbers depend on."""
    found = {"kpred": __version__, "python": platform.python_version()}
    for name in LIBRARIES:
        try:
            found[name] = version(name)
        except PackageNotFoundError:
            found[name] = ""
    return found


def _deformation(fit: Fit) -> dict[str, Any]:
    """Describe what was done to the model: placed, sized, its structure's unknowns, or its keypoints moved."""
    explanation, entry = fit.placed.explanation, fit.placed.entry
    placement, structure = explanation.placement, explanation.structure
    bent = explanation.step in ("free", "paper")
    moved = fit.frame.to_unit(np.asarray(fit.keypoints, dtype=np.float64)) - entry.keypoints
    return {
        "step": explanation.step,
        "yaw": placement.yaw,
        "size": placement.size.tolist(),
        "shift": placement.shift.tolist(),
        "part_growth": None if structure is None else structure.growth().tolist(),
        "structure_unknowns": None if structure is None else structure.solution.tolist(),
        "keypoint_displacement": moved.tolist() if bent else None,
    }


def _database_path(path: Path | str) -> str:
    if is_address(path):
        return str(path)
    file = Path(path)
    return BUNDLED_DATABASE if file == bundled_database_path() else str(file.absolute())


def _model_name(name: str) -> str:
    return str(Path(name).absolute()) if is_folder_name(name) else name
