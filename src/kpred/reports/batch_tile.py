"""Pictures of a batch's scans, drawn from the files that the batch left."""

from __future__ import annotations

import json
import warnings
from pathlib import Path
from typing import Any

import numpy as np
import trimesh
from PIL import Image

from kpred.errors import KpredError
from kpred.fitting.export import upright_of
from kpred.ops.typing import Float, UInt8
from kpred.rendering.contact_sheet import Tile, draw_tile
from kpred.shapes.mesh_io import MESH_EXTENSIONS, read_geometry
from kpred.shapes.scan import SCAN_EXTENSIONS, read_scan

HEIGHT = 130
"""Pixels of a picture."""

MAX_POINTS = 3000
"""Points of a scan that are drawn."""

MAX_BYTES = 50_000_000
"""Size of a scan or mesh that is read once more for a picture."""


def draw_result(row: dict[str, Any], folder: Path) -> UInt8[np.ndarray, "height width 3"] | None:
    """Draw scan, result and both of a line of `results.jsonl`; None where its files are gone or hold no mesh."""
    try:
        record = json.loads((folder / row["record"]).read_text(encoding="utf-8"))
        to_unit = np.linalg.inv(np.asarray(record["unit_box_to_scan"], dtype=np.float64).reshape(4, 4))
        scan = _moved(to_unit, _points(Path(record["scan"])))
        mesh = _mesh(folder / row["mesh"], record, to_unit) if row.get("mesh") else None
    except (KpredError, OSError, ValueError, KeyError, TypeError, RecursionError, np.linalg.LinAlgError):
        return None
    return _small(draw_tile(Tile((), "open", scan, mesh)), 3 if mesh is not None else 1)


def draw_failure(name: str, source: Path | None) -> UInt8[np.ndarray, "height width 3"] | None:
    """Draw a scan that failed, as it stands; None where it is not in the folder, or cannot be read."""
    if source is None or not source.is_dir():
        return None
    try:
        return _small(draw_tile(Tile((), "open", _points(source / name))), 1)
    except (KpredError, OSError, ValueError):
        return None


def _points(file: Path) -> Float[np.ndarray, "points 3"]:
    if file.suffix.lower() not in SCAN_EXTENSIONS or file.stat().st_size > MAX_BYTES:
        raise ValueError(f"{file}: no small scan")
    with warnings.catch_warnings(action="ignore"):
        return read_scan(file, MAX_POINTS)


def _mesh(file: Path, record: dict[str, Any], to_unit: np.ndarray) -> trimesh.Trimesh | None:
    """Read a mesh that the batch wrote into the unit box; None for formats that are not read."""
    if file.suffix.lower() not in MESH_EXTENSIONS or file.stat().st_size > MAX_BYTES:
        return None
    geometry = read_geometry(file)
    vertices = geometry.vertices
    if file.suffix.lower() == ".glb":
        # Metres, y up: back to the scan's frame and unit.
        vertices = vertices @ upright_of(np.asarray(record["up"], dtype=np.float64)) / float(record["unit"]["metres"])
    return trimesh.Trimesh(_moved(to_unit, vertices), geometry.faces, process=False)


def _moved(matrix: np.ndarray, points: np.ndarray) -> np.ndarray:
    moved: np.ndarray = points @ matrix[:3, :3].T + matrix[:3, 3]
    return moved


def _small(tile: UInt8[np.ndarray, "height width 3"], panels: int) -> UInt8[np.ndarray, "side across 3"]:
    side = tile.shape[0]
    shown = Image.fromarray(tile[:, : panels * side])
    return np.asarray(shown.resize((panels * HEIGHT, HEIGHT), Image.Resampling.LANCZOS))
