"""Files of a result, in every format of `kpred.exports`."""

from __future__ import annotations

import os
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from kpred.atomic import write_together
from kpred.exports.formats import export_writers
from kpred.exports.furniture import WOOD, Export, Furniture
from kpred.exports.writer import Writer
from kpred.ops.rotations import UP_AXES, upright_rotation
from kpred.ops.typing import Float

if TYPE_CHECKING:
    from kpred.fitting.result import Fit


def furniture_of(fit: Fit, name: str = "") -> Furniture:
    """Return what exports need of a fit; `name`: of its node, by default the model's id.

    Raises:
        DatabaseError: the model's materials cannot be read.
    """
    entry = fit.placed.entry
    return Furniture(
        name=name or fit.source.model_id,
        vertices=np.asarray(fit.mesh.vertices, dtype=np.float64),
        faces=np.asarray(fit.mesh.faces),
        parts=entry.structure.vertex_parts,
        source=np.asarray(entry.mesh.vertices, dtype=np.float64),
        rotation=fit.frame.rotation,
        axes=np.asarray(entry.structure.axes, dtype=np.float64),
        credit=fit.credit,
        appearance=fit.read_appearance(),
    )


def upright_of(up: Float[np.ndarray, "3"]) -> Float[np.ndarray, "3 3"]:
    """Return the rotation of an up direction (3,) to +y: that of the named axis, if it is one, else the shortest."""
    for name, axis in UP_AXES.items():
        if np.allclose(up, axis, atol=1e-9):
            return upright_rotation(name)
    side = np.cross(up, [0.0, 1.0, 0.0])
    cross = np.array([[0, -side[2], side[1]], [side[2], 0, -side[0]], [-side[1], side[0], 0]])
    found: np.ndarray = np.eye(3) + cross + cross @ cross / (1 + up[1])
    return found


def export_of(fit: Fit, name: str = "", density: float = WOOD) -> Export:
    """Return a fit as an export of one object; `density`: kg per cubic metre, for simulations."""
    return Export((furniture_of(fit, name),), upright_of(fit.up), fit.unit.metres, density)


def result_writers(fit: Fit, path: Path, density: float = WOOD) -> dict[Path, Writer]:
    """List the files of a result with what writes each: the mesh first, then what lies beside it (`STEM_*`).

    Raises:
        OutputError: unknown extension, a library of the format is missing, or the mesh is not finite.
        DatabaseError: the model's materials cannot be read.
    """
    return export_writers(export_of(fit, density=density), path)


def save_result(fit: Fit, path: str | os.PathLike[str], density: float = WOOD) -> list[Path]:
    """Write the files of a result, all of them or none, and return them.

    Raises:
        OutputError: as `result_writers`, or a file cannot be written there.
    """
    writers = result_writers(fit, Path(path), density)
    write_together(writers)
    return list(writers)
