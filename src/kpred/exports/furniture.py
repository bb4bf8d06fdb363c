"""What is exported: fitted furniture in the frame of its scan, and how that frame stands in the world."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from kpred.ops.rotations import Y_TO_Z
from kpred.ops.typing import Float, Int
from kpred.shapes.appearance.appearance import Appearance
from kpred.shapes.credit import Credit

WOOD = 600.0
"""Density of wood, kg per cubic metre."""

FRONT_X = np.array([[0.0, 0.0, 1.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]])
"""Rotation from y up, front +z to z up, front +x, as robots and simulations have it."""


@dataclass(frozen=True, eq=False)
class Furniture:
    """One deformed CAD model of V vertices and F faces, in the scan's frame and unit.

    Attributes:
        name: of nodes and bodies; unique in an export.
        vertices: (V, 3); faces: (F, 3); parts: (V,) the part of the model that each vertex belongs to.
        source: (V, 3) the vertices of the model as it is in the database.
        rotation: (3, 3) from the scan's axes to y up, front +z.
        axes: (C, 3, 3) rows are the directions of each part's own box, y up, front +z.
        credit: the model, its author and licence; appearance: materials and names; None where nothing was kept.
    """

    name: str
    vertices: Float[np.ndarray, "vertices 3"]
    faces: Int[np.ndarray, "faces 3"]
    parts: Int[np.ndarray, " vertices"]
    source: Float[np.ndarray, "vertices 3"]
    rotation: Float[np.ndarray, "3 3"]
    axes: Float[np.ndarray, "parts 3 3"]
    credit: Credit
    appearance: Appearance | None = None


@dataclass(frozen=True, eq=False)
class Export:
    """Furniture of one scan.

    Attributes:
        objects: at least one; upright: (3, 3) rotation of the scan's axes to y up; metres: length of the scan's unit.
        density: of the material, kg per cubic metre.
    """

    objects: tuple[Furniture, ...]
    upright: Float[np.ndarray, "3 3"]
    metres: float = 1.0
    density: float = WOOD

    @cached_property
    def scan_to_y_up(self) -> Float[np.ndarray, "4 4"]:
        """Matrix from the scan's frame and unit to metres, y up, as in glTF and USD."""
        matrix = np.eye(4)
        matrix[:3, :3] = self.metres * self.upright
        return matrix

    @cached_property
    def scan_to_z_up(self) -> Float[np.ndarray, "4 4"]:
        """Matrix from the scan's frame and unit to metres, z up, as in simulations and buildings."""
        matrix = np.eye(4)
        matrix[:3, :3] = self.metres * Y_TO_Z @ self.upright
        return matrix

    def body_frame(self, furniture: Furniture) -> Float[np.ndarray, "4 4"]:
        """Return the rigid matrix from an object's own frame to metres, z up.

        The own frame has z up, x to the front, and its origin on the floor below the middle of the object's box.
        """
        rotation = FRONT_X @ furniture.rotation
        own = furniture.vertices @ rotation.T
        low, high = own.min(axis=0), own.max(axis=0)
        origin = rotation.T @ np.append((low + high)[:2] / 2, low[2])
        matrix = np.eye(4)
        matrix[:3, :3] = Y_TO_Z @ self.upright @ rotation.T
        matrix[:3, 3] = self.scan_to_z_up[:3, :3] @ origin
        return matrix

    def scan_to_body(self, furniture: Furniture) -> Float[np.ndarray, "4 4"]:
        """Return the matrix from the scan's frame and unit to an object's own frame in metres."""
        found: np.ndarray = np.linalg.inv(self.body_frame(furniture)) @ self.scan_to_z_up
        return found


def moved(matrix: Float[np.ndarray, "4 4"], points: Float[np.ndarray, "points 3"]) -> Float[np.ndarray, "points 3"]:
    """Transform points (N, 3) by a matrix that acts on column vectors."""
    found: np.ndarray = np.asarray(points, dtype=np.float64) @ matrix[:3, :3].T + matrix[:3, 3]
    return found
