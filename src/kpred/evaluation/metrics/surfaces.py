"""Exact distances to a triangle mesh's surface, in its own frame and unit."""

from __future__ import annotations

import numpy as np
import trimesh

from kpred.errors import MeshError
from kpred.ops.closest_point import closest_points
from kpred.ops.typing import Float


class Surface:
    """A mesh's surface, to measure distances to.

    Args:
        mesh: with at least one face, in any frame and unit.

    Raises:
        MeshError: it has no face.
    """

    def __init__(self, mesh: trimesh.Trimesh) -> None:
        if not len(mesh.faces):
            raise MeshError("The mesh has no face; there is no surface to measure distances to.")
        vertices = np.asarray(mesh.vertices, dtype=np.float64)
        # In a place of its own: far from the origin squares lose digits.
        self.middle = vertices.mean(axis=0)
        self._vertices, self._faces = vertices - self.middle, np.asarray(mesh.faces, dtype=np.int64)

    def distances(self, points: Float[np.ndarray, "points 3"]) -> Float[np.ndarray, " points"]:
        """Compute the distance from each point to the surface, in the mesh's unit."""
        found, _ = closest_points(points.astype(np.float64) - self.middle, self._vertices, self._faces)
        return found
