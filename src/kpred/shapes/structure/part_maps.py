"""How each part of a deformed mesh moved: its best affine map, and the best box-like one."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from kpred.ops.typing import Bool, Float, Int
from kpred.shapes.structure.groups import group_covariances, group_means

MIN_EXTENT = 1e-4
"""Parts thinner than this along an axis of their own are flat along it, unit box."""

_RIDGE = 1e-12
_ROUNDS = 10


@dataclass(frozen=True, eq=False)
class PartMaps:
    """Best affine maps of C parts, x -> linear (x - source_means) + result_means.

    Attributes:
        linear: (C, 3, 3); source_means, result_means: (C, 3) of the parts' vertices.
        covariances: (C, 3, 3) of the source's vertices; crossed: (C, 3, 3) of the result's (rows) with the source's.
    """

    linear: Float[np.ndarray, "parts 3 3"]
    source_means: Float[np.ndarray, "parts 3"]
    result_means: Float[np.ndarray, "parts 3"]
    covariances: Float[np.ndarray, "parts 3 3"]
    crossed: Float[np.ndarray, "parts 3 3"]

    def carry(
        self, points: Float[np.ndarray, "points 3"], parts: Int[np.ndarray, " points"]
    ) -> Float[np.ndarray, "points 3"]:
        """Map points of the source, each by the map of a part, into the result."""
        moved = np.einsum("pij,pj->pi", self.linear[parts], points - self.source_means[parts])
        return moved + self.result_means[parts]


def fit_part_maps(
    source: Float[np.ndarray, "vertices 3"],
    result: Float[np.ndarray, "vertices 3"],
    parts: Int[np.ndarray, " vertices"],
    count: int,
) -> PartMaps:
    """Fit the affine map of each of `count` parts to its vertices; both meshes in about a unit box.

    What the vertices of a part leave open (the direction across a flat one) follows the map of the whole mesh.
    """
    whole = np.zeros(len(source), np.int64)
    ridge = _RIDGE * np.eye(3)
    total = group_covariances(result, source, whole, 1)[0] + ridge
    everywhere = np.linalg.solve(group_covariances(source, source, whole, 1)[0] + ridge, total.T).T
    covariances = group_covariances(source, source, parts, count)
    crossed = group_covariances(result, source, parts, count)
    # (M + r W) (S + r)^-1, by the transposed system: S is symmetric.
    linear = np.linalg.solve(covariances + ridge, (crossed + _RIDGE * everywhere).transpose(0, 2, 1))
    return PartMaps(
        linear=linear.transpose(0, 2, 1),
        source_means=group_means(source, parts, count),
        result_means=group_means(result, parts, count),
        covariances=covariances,
        crossed=crossed,
    )


def own_extents(
    source: Float[np.ndarray, "vertices 3"], parts: Int[np.ndarray, " vertices"], axes: Float[np.ndarray, "parts 3 3"]
) -> Float[np.ndarray, "parts 3"]:
    """Measure the parts along their own axes (rows of `axes`), unit of the vertices; 0 for parts without vertices."""
    local = np.einsum("vij,vj->vi", axes[parts], source)
    low, high = np.full((len(axes), 3), np.inf), np.full((len(axes), 3), -np.inf)
    np.minimum.at(low, parts, local)
    np.maximum.at(high, parts, local)
    return np.maximum(np.where(np.isfinite(low), high, 0.0) - np.where(np.isfinite(low), low, 0.0), 0.0)


def measure_shears(
    maps: PartMaps, axes: Float[np.ndarray, "parts 3 3"], extents: Float[np.ndarray, "parts 3"]
) -> Float[np.ndarray, " parts"]:
    """Compute the largest change of the right angles between each part's own axes, degrees; flat axes aside."""
    images = np.einsum("pij,pkj->pki", maps.linear, axes)
    units = images / np.maximum(np.linalg.norm(images, axis=2, keepdims=True), 1e-300)
    solid = (extents > MIN_EXTENT) & (units != 0).any(axis=2)
    worst = np.zeros(len(axes))
    for i, j in ((0, 1), (1, 2), (2, 0)):
        off = np.degrees(np.abs(np.arcsin(np.clip(np.einsum("pi,pi->p", units[:, i], units[:, j]), -1.0, 1.0))))
        worst = np.maximum(worst, np.where(solid[:, i] & solid[:, j], off, 0.0))
    return worst


def box_residuals(
    source: Float[np.ndarray, "vertices 3"],
    result: Float[np.ndarray, "vertices 3"],
    parts: Int[np.ndarray, " vertices"],
    axes: Float[np.ndarray, "parts 3 3"],
    maps: PartMaps,
) -> Float[np.ndarray, " parts"]:
    """Compute the RMS distance of each part to its best rotated, axis-scaled copy, in the unit of the result."""
    to_own = axes.transpose(0, 2, 1)
    crossed = maps.crossed @ to_own
    squares = np.einsum("pki,pij,pkj->pk", axes, maps.covariances, axes)
    images = maps.linear @ to_own
    scales = np.linalg.norm(images, axis=1)
    rotations = _nearest_rotations(images / np.where(scales == 0, 1.0, scales)[:, None, :])
    # Alternate the best scales for these rotations and the best rotations for these scales.
    for _ in range(_ROUNDS):
        along = np.einsum("pik,pik->pk", rotations, crossed)
        scales = (along + _RIDGE * scales) / (squares + _RIDGE)
        rotations = _nearest_rotations(crossed * scales[:, None, :])
    along = np.einsum("pik,pik->pk", rotations, crossed)
    scales = (along + _RIDGE * scales) / (squares + _RIDGE)
    own = np.einsum("vij,vj->vi", axes[parts], source - maps.source_means[parts])
    copy = np.einsum("vij,vj->vi", rotations[parts], own * scales[parts]) + maps.result_means[parts]
    off = np.einsum("vi,vi->v", result - copy, result - copy)
    return np.sqrt(group_means(off[:, None], parts, len(axes))[:, 0])


def _nearest_rotations(matrices: np.ndarray) -> np.ndarray:
    left, _, right = np.linalg.svd(matrices)
    # A reflection is no rotation: the weakest direction is taken the other way.
    left[:, :, 2] *= np.where(np.linalg.det(left @ right) < 0, -1.0, 1.0)[:, None]
    rotations: np.ndarray = left @ right
    return rotations


def find_folded(
    maps: PartMaps,
    source_normals: Float[np.ndarray, "faces 3"],
    result_normals: Float[np.ndarray, "faces 3"],
    parts: Int[np.ndarray, " faces"],
    flat: Bool[np.ndarray, " parts"],
) -> Bool[np.ndarray, " faces"]:
    """Find faces more than 90 degrees off their source normal, carried by the map of their part.

    Args:
        source_normals, result_normals: by winding, zero for faces that are left out; flat: parts without volume, whose
            maps have no handedness.
    """
    columns = maps.linear.transpose(0, 2, 1)
    cofactors = np.stack([np.cross(columns[:, (k + 1) % 3], columns[:, (k + 2) % 3]) for k in range(3)], axis=2)
    # The inverse transpose times the size of the determinant: it exists for maps onto a plane as well.
    handed = np.where((np.linalg.det(maps.linear) < 0) & ~flat, -1.0, 1.0)
    carried = np.einsum("fij,fj->fi", (cofactors * handed[:, None, None])[parts], source_normals)
    found: np.ndarray = np.einsum("fi,fi->f", carried, result_normals) < 0
    return found
