"""Distances to a triangle mesh's surface, by so many samples of it that their spacing hardly counts."""

from __future__ import annotations

import numpy as np
import torch
import trimesh
from scipy.spatial import cKDTree

from kpred.ops import sample_surface
from kpred.ops.typing import Float

SAMPLES = 65_536
"""On a surface of 12 (unit box) they add 6e-5 to a mean squared distance."""


class Surface:
    """A mesh's surface, to measure distances to.

    Args:
        mesh: with a face of non-zero area, in any frame and unit.
        seed: of the samples.

    Raises:
        MeshError: no face has an area.
    """

    def __init__(self, mesh: trimesh.Trimesh, seed: int) -> None:
        # In a place and size of its own before it loses digits to single precision.
        vertices = np.asarray(mesh.vertices, dtype=np.float64)
        self.middle = vertices.mean(axis=0)
        points, _ = sample_surface(
            torch.from_numpy(vertices - self.middle),
            torch.from_numpy(np.asarray(mesh.faces, dtype=np.int64)),
            SAMPLES,
            torch.Generator().manual_seed(seed),
        )
        self._tree = cKDTree(points.numpy())

    def distances(self, points: Float[np.ndarray, "points 3"]) -> Float[np.ndarray, " points"]:
        """From each point to the surface, in the mesh's frame and unit."""
        found: np.ndarray = self._tree.query(points - self.middle)[0]
        return found
