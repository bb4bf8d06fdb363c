"""Skins of glTF meshes: vertices where the joints of the file's own pose put them."""

from __future__ import annotations

from typing import Any

import numpy as np

from kpred.errors import MeshError
from kpred.shapes.formats.gltf_accessor import read_accessor
from kpred.shapes.formats.gltf_file import GltfFile

_MAX_SETS = 4
"""Sets of four joints a vertex."""


def skin_vertices(
    file: GltfFile,
    skin: Any,
    attributes: dict[str, Any],
    vertices: np.ndarray,
    worlds: dict[int, np.ndarray],
    own: np.ndarray,
) -> np.ndarray:
    """Move vertices (N, 3) of a mesh into the world by the joints of its skin, or by its node where that is damaged.

    Args:
        attributes: of the primitive, among them joints and weights.
        worlds: (4, 4) transforms of nodes to the world.
        own: (4, 4) that of the mesh's node, which has no effect on a skinned mesh.
    """
    try:
        matrices = _joints(file, skin, worlds)
        moved = _weighted(file, attributes, vertices, matrices)
    except (MeshError, TypeError, ValueError, KeyError):
        moved = None
    return vertices @ own[:3, :3].T + own[:3, 3] if moved is None else moved


def _joints(file: GltfFile, skin: Any, worlds: dict[int, np.ndarray]) -> np.ndarray:
    """Return the (J, 4, 4) matrices of the joints, which act on vertices of the mesh."""
    entry = file.item("skins", skin)
    matrices = np.stack([worlds[joint] for joint in entry["joints"]])
    if entry.get("inverseBindMatrices") is None:
        return matrices
    inverse = read_accessor(file, entry["inverseBindMatrices"]).astype(np.float64)[: len(matrices)]
    return matrices @ inverse.reshape(-1, 4, 4).transpose(0, 2, 1)


def _weighted(
    file: GltfFile, attributes: dict[str, Any], vertices: np.ndarray, matrices: np.ndarray
) -> np.ndarray | None:
    """Return the mean of vertices (N, 3) moved by each of their joints; None where some have none."""
    moved, total = np.zeros_like(vertices), np.zeros(len(vertices))
    for number in range(_MAX_SETS):
        names = f"JOINTS_{number}", f"WEIGHTS_{number}"
        if any(name not in attributes for name in names):
            break
        rows, weights = (read_accessor(file, attributes[name]) for name in names)
        if rows.shape != (len(vertices), 4) or weights.shape != rows.shape or rows.max(initial=0) >= len(matrices):
            return None
        for corner in range(4):
            weight, matrix = weights[:, corner].astype(np.float64), matrices[rows[:, corner].astype(np.int64)]
            placed = np.einsum("nij,nj->ni", matrix[:, :3, :3], vertices) + matrix[:, :3, 3]
            moved, total = moved + weight[:, None] * placed, total + weight
    if not np.isfinite(moved).all() or not (total > 0).all():
        return None
    result: np.ndarray = moved / total[:, None]
    return result
