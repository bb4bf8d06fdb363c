"""A mesh of any axes and unit, stood up: y up, front +z, in metres where its size is known."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from kpred.errors import MeshError
from kpred.ops.rotations import UP_AXES
from kpred.ops.typing import Float
from kpred.shapes.mesh import Mesh

SAME_SHAPE = 1.15
"""Sides of a box and those written of it may differ so much, by a factor, beyond the unit."""

SAME_UNIT = 0.03
"""A mesh whose size differs by no more than this fraction keeps its numbers."""


def axis_rotation(up: str, front: str) -> Float[np.ndarray, "3 3"]:
    """Rotate the axes `up` and `front` (`x` ... `-z`, not along one axis) to y and +z."""
    upward, forward = (np.array(UP_AXES[name], dtype=np.float64) for name in (up, front))
    return np.stack([np.cross(upward, forward), upward, forward])


def stand_mesh(mesh: Mesh, up: str, front: str, size: Sequence[float] | None) -> Mesh:
    """Rotate a mesh to y up, front +z, and scale it to a size (width, height, depth) in metres.

    Raises:
        MeshError: its sides are not in the proportion of the size.
    """
    rotation = axis_rotation(up, front)
    vertices = mesh.vertices.astype(np.float64) @ rotation.T
    scale = 1.0
    if size is not None:
        extent = np.maximum(np.ptp(vertices[np.unique(mesh.faces)], axis=0), np.finfo(float).tiny)
        ratio = np.asarray(size) / extent
        thick = extent > 0.01 * extent.max()
        factors = ratio[thick]
        if factors.max() > SAME_SHAPE * factors.min():
            sides, wanted = (" x ".join(f"{side:.3g}" for side in box) for box in (extent, size))
            raise MeshError(
                f"{mesh.name}: its box is {sides}, which is not {wanted} m in any unit; mend its up, front or size in "
                "the manifest."
            )
        scale = float(np.exp(np.log(factors).mean()))
    if abs(scale - 1.0) <= SAME_UNIT:
        scale = 1.0
    if scale == 1.0 and np.array_equal(rotation, np.eye(3)):
        return mesh
    return Mesh((vertices * scale).astype(np.float32), mesh.faces, mesh.name, mesh.face_parts)
