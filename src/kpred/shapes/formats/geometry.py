"""Geometry of a mesh file, as its reader returns it."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from kpred.ops.typing import Float, Int


class Geometry(NamedTuple):
    """Vertices (V, 3) float64, triangles (F, 3) int64 (none for a point cloud) and parts (F,) int64 of a file."""

    vertices: Float[np.ndarray, "vertices 3"]
    faces: Int[np.ndarray, "faces 3"]
    parts: Int[np.ndarray, " faces"]
