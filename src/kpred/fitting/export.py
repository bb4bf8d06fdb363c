"""Files of a result: the mesh with the materials, textures and names that the database kept of its model."""

from __future__ import annotations

import os
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from kpred.atomic import write_together
from kpred.shapes.appearance.write import EXTENSIONS, appearance_files
from kpred.shapes.mesh_output import check_mesh, write_mesh

if TYPE_CHECKING:
    from kpred.fitting.result import Fit

Writer = Callable[[Path], object]


def result_writers(fit: Fit, path: Path) -> dict[Path, Writer]:
    """List the files of a result with what writes each: the mesh first, then materials and textures beside it.

    Files beside `x.obj` are `x.mtl` and `x_*`. Formats other than .obj and .glb hold the surface alone.

    Raises:
        OutputError: unknown extension, or the mesh is not finite.
        DatabaseError: the model's materials cannot be read.
    """
    check_mesh(path, fit.mesh)
    appearance = fit.read_appearance() if path.suffix.lower() in EXTENSIONS else None
    if appearance is None:
        return {path: lambda file: write_mesh(file, fit.mesh, fit.credit)}
    source = np.asarray(fit.placed.entry.mesh.vertices, dtype=np.float64)
    result = np.asarray(fit.mesh.vertices, dtype=np.float64)
    name = f"{path.stem}{path.suffix.lower()}"
    files = appearance_files(appearance, source, result, name, fit.credit)
    writers: dict[Path, Writer] = {path: _writer(files.pop(name))}
    return writers | {path.with_name(beside): _writer(content) for beside, content in files.items()}


def save_result(fit: Fit, path: str | os.PathLike[str]) -> list[Path]:
    """Write the files of a result, all of them or none, and return them.

    Raises:
        OutputError: unknown extension, or a file cannot be written there.
    """
    writers = result_writers(fit, Path(path))
    write_together(writers)
    return list(writers)


def _writer(content: bytes) -> Writer:
    return lambda file: file.write_bytes(content)
