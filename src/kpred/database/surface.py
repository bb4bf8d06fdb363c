"""Structure of a model's mesh, and the part and the normal of each sampled point."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from kpred.ops.typing import Float, Int
from kpred.shapes.structure import Structure
from kpred.shapes.structure.analyse import find_structure


@dataclass(frozen=True, eq=False)
class SurfaceAnalysis:
    """Structure of a mesh in its unit box, seen from N points on it.

    Attributes:
        point_parts: (N,) int16 part that each point lies on.
        point_normals: (N, 3) float32 unit normal of the face that each point lies on, of the sign that points away
            from the middle of the part's own box: winding is not relied on.
    """

    structure: Structure
    point_parts: Int[np.ndarray, " points"]
    point_normals: Float[np.ndarray, "points 3"]


def analyse_surface(
    vertices: Float[np.ndarray, "vertices 3"],
    faces: Int[np.ndarray, "faces 3"],
    points: Float[np.ndarray, "points 3"],
    point_faces: Int[np.ndarray, " points"],
) -> SurfaceAnalysis:
    """Find the structure of a mesh, and the parts and normals of points on it; unit box.

    Args:
        points: samples of the surface; point_faces: the face that each lies on.
    """
    structure = find_structure(vertices, faces, points, point_faces)
    parts = structure.vertex_parts[faces[point_faces, 0]]
    corners = np.asarray(vertices, np.float64)[faces[point_faces]]
    crossed = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    normals = crossed / np.maximum(np.linalg.norm(crossed, axis=1, keepdims=True), 1e-300)
    middles = np.einsum("ck,ckj->cj", structure.boxes.mean(axis=1), structure.axes)
    outward = np.einsum("ij,ij->i", normals, points - middles[parts])
    normals = np.where(outward[:, None] < 0, -normals, normals)
    return SurfaceAnalysis(structure, parts.astype(np.int16), normals.astype(np.float32))
