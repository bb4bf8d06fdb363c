"""The interface of data sets: their shapes as files, without reading any, and what is missing."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Literal, Protocol, runtime_checkable

import numpy as np

from kpred.datasets.check import Check, counted
from kpred.shapes.mesh import Mesh

FileFrame = Literal["none", "half", "z_up"]

_ROTATIONS: dict[FileFrame, np.ndarray] = {
    "none": np.eye(3, dtype=np.float32),
    # ShapeNetCore.v2: y up, front -z.
    "half": np.diag(np.array([-1, 1, -1], dtype=np.float32)),
    # z up: (x, y, z) -> (x, z, -y).
    "z_up": np.array([[1, 0, 0], [0, 0, 1], [0, -1, 0]], dtype=np.float32),
}


@dataclass(frozen=True)
class ShapeFile:
    """One shape of a data set, not read yet.

    Attributes:
        model_id, category, split: as a mesh pack has them.
        path: its mesh file.
        file_frame: what takes the file's frame to y up, front +z: nothing, half a turn about y, or z up to y up.
    """

    model_id: str
    category: str
    split: str
    path: Path
    file_frame: FileFrame = "none"

    def read(self) -> Mesh:
        """Read the cleaned mesh, y up and front +z, in the file's units.

        Raises:
            MeshError: it cannot be read, or no face has an area.
        """
        from kpred.shapes.mesh_io import read_mesh

        mesh = read_mesh(self.path)
        return Mesh(mesh.vertices @ _ROTATIONS[self.file_frame].T, mesh.faces, self.model_id, mesh.face_parts)


@runtime_checkable
class Dataset(Protocol):
    """A data set on disk."""

    @property
    def kind(self) -> str:
        """The word for its layout."""
        ...

    @property
    def path(self) -> Path:
        """Where it lies."""
        ...

    def shapes(self) -> Sequence[ShapeFile]:
        """List all shapes present, in a fixed order, without reading their files.

        Raises:
            PackError: the data set's own files (split, annotation) are missing or broken, or it has no shape.
        """
        ...

    def check(self) -> Check:
        """Report what is present and what is missing.

        Raises:
            PackError: as in `shapes`, but not for a lack of shapes.
        """
        ...


def found_in(shapes: Sequence[ShapeFile]) -> dict[str, dict[str, int]]:
    """Count shapes by category and split."""
    return counted((shape.category, shape.split) for shape in shapes)
