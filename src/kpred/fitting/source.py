"""What a fit was made from: the scan, the networks, the database and the options."""

from __future__ import annotations

import hashlib
import os
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from kpred.errors import ScanError
from kpred.file_hash import file_sha256
from kpred.fitting.options import FitOptions
from kpred.fitting.stages import Context
from kpred.ops.typing import Float


@dataclass(frozen=True, eq=False)
class FitSource:
    """All that a fit depends on.

    Attributes:
        context: networks, database and categories; options: of the fit.
        points: number of points that it started with; points_sha256: of them, before cleaning.
        file: the scan's file, absolute; None where the scan came as an array.
    """

    context: Context
    options: FitOptions
    points: int
    points_sha256: str
    file: Path | None = None

    @classmethod
    def of(
        cls,
        scan: str | os.PathLike[str] | np.ndarray,
        points: Float[np.ndarray, "points 3"],
        context: Context,
        options: FitOptions,
    ) -> FitSource:
        """Note what a fit starts with; `points`: of the scan, at most 50,000, as they were read."""
        file = None if isinstance(scan, np.ndarray) else Path(os.path.abspath(scan))
        digest = hashlib.sha256(np.ascontiguousarray(points, dtype="<f8").tobytes()).hexdigest()
        return cls(context, options, len(points), digest, file)

    def from_file(self, file: str | os.PathLike[str]) -> FitSource:
        """Note the file from which the scan's array had been read."""
        return replace(self, file=Path(os.path.abspath(file)))


def scan_sha256(file: Path) -> str:
    """Hash the file of a scan, as 64 hexadecimal digits.

    Raises:
        ScanError: it cannot be read.
    """
    try:
        return file_sha256(file)
    except OSError as error:
        raise ScanError(f"{file}: {error.strerror or error}; give the file of the scan.") from error


def mesh_sha256(vertices: Float[np.ndarray, "vertices 3"], faces: np.ndarray) -> str:
    """Hash a mesh to the bit: vertices as float64, faces as int64."""
    digest = hashlib.sha256(np.ascontiguousarray(vertices, dtype="<f8").tobytes())
    digest.update(np.ascontiguousarray(faces, dtype="<i8").tobytes())
    return digest.hexdigest()
