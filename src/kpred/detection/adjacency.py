"""Which pieces of a room touch, and numbers that say whether two of them are of one object."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.spatial import cKDTree

from kpred.ops.typing import Float, Int

CELL = 0.04
GAP = 0.09
"""Metres: pieces touch where cells of the first size hold both within the second; thin parts are often cut."""

PIECE_FEATURES = 14
PAIR_FEATURES = 2 * PIECE_FEATURES + 12


@dataclass(frozen=True, eq=False)
class Pieces:
    """The pieces of a room, metres, z up, floor at 0.

    Attributes:
        segment: (V,) piece of each voxel.
        features: (P, PIECE_FEATURES) of each piece alone.
        normals: (P, 3) its mean plane's normal; middle: (P, 3); low, high: (P, 3) corners of its box.
        sizes: (P,) voxels.
    """

    segment: Int[np.ndarray, " voxels"]
    features: Float[np.ndarray, "pieces features"]
    normals: Float[np.ndarray, "pieces 3"]
    middle: Float[np.ndarray, "pieces 3"]
    low: Float[np.ndarray, "pieces 3"]
    high: Float[np.ndarray, "pieces 3"]
    sizes: Int[np.ndarray, " pieces"]


def describe_pieces(
    points: Float[np.ndarray, "voxels 3"],
    normals: Float[np.ndarray, "voxels 3"],
    segment: Int[np.ndarray, " voxels"],
    structure: Float[np.ndarray, "others 3"],
    cell: float,
) -> Pieces:
    """Describe every piece; `structure` holds the points of floor, walls and ceiling, `cell` the voxels' edge."""
    count = int(segment.max()) + 1
    sizes = np.bincount(segment, minlength=count)
    middle = _means(points, segment, sizes)
    offset = points - middle[segment]
    outer = (offset[:, :, None] * offset[:, None, :]).reshape(-1, 9)
    values, vectors = np.linalg.eigh(_means(outer, segment, sizes).reshape(-1, 3, 3))
    deviation = np.sqrt(np.maximum(values, 0.0))
    low, high = np.full((count, 3), np.inf), np.full((count, 3), -np.inf)
    np.minimum.at(low, segment, points)
    np.maximum.at(high, segment, points)
    if len(structure):
        far = cKDTree(structure, balanced_tree=False).query(points, distance_upper_bound=0.3)[0].clip(max=0.3)
    else:
        far = np.full(len(points), 0.3)
    near = np.full(count, 0.3)
    np.minimum.at(near, segment, far)
    plane = vectors[:, :, 0]
    facing = _means(np.abs((normals * plane[segment]).sum(axis=1))[:, None], segment, sizes)[:, 0]
    upright = _means(np.abs(normals[:, 2])[:, None], segment, sizes)[:, 0]
    area = sizes * cell**2
    features = np.column_stack(
        [
            *(np.log(sizes), np.log(area + 1e-3), deviation * 4.0, low[:, 2], high[:, 2], middle[:, 2]),
            *(np.abs(plane[:, 2]), upright, facing, np.abs(vectors[:, 2, 2]), near),
            _means((far < 0.08)[:, None].astype(float), segment, sizes)[:, 0],
        ]
    )
    return Pieces(segment, features, plane, middle, low, high, sizes)


def touching(points: Float[np.ndarray, "voxels 3"], pieces: Pieces) -> tuple[Int[np.ndarray, "pairs 2"], np.ndarray]:
    """List pairs of pieces that touch, each once, and (pairs, 5): how much, how near, and where."""
    index = np.floor((points - points.min(axis=0)) / CELL).astype(np.int64)
    shape = index.max(axis=0) + 1
    code = ((index[:, 0] * shape[1] + index[:, 1]) * shape[2] + index[:, 2]) * len(pieces.sizes) + pieces.segment
    _, owner = np.unique(code, return_inverse=True)
    counts = np.bincount(owner)
    places = _means(points, owner, counts)
    piece = np.zeros(len(counts), np.int64)
    piece[owner] = pieces.segment
    near = cKDTree(places, balanced_tree=False).query_pairs(GAP, output_type="ndarray")
    one, other = piece[near].T
    apart = one != other
    near, one, other = near[apart], one[apart], other[apart]
    distance = np.linalg.norm(places[near[:, 0]] - places[near[:, 1]], axis=1)
    height = (places[near[:, 0], 2] + places[near[:, 1], 2]) / 2
    pair = np.minimum(one, other) * len(pieces.sizes) + np.maximum(one, other)
    unique, group = np.unique(pair, return_inverse=True)
    total = np.bincount(group, minlength=len(unique))
    least = np.full(len(unique), np.inf)
    np.minimum.at(least, group, distance)
    low, high = np.full(len(unique), np.inf), np.full(len(unique), -np.inf)
    np.minimum.at(low, group, height)
    np.maximum.at(high, group, height)
    mean = np.bincount(group, distance, minlength=len(unique)) / np.maximum(total, 1)
    contact = np.column_stack([np.log1p(total), least / GAP, mean / GAP, low, high - low])
    return np.column_stack([unique // len(pieces.sizes), unique % len(pieces.sizes)]), contact


def pair_features(
    pieces: Pieces, pairs: Int[np.ndarray, "pairs 2"], contact: Float[np.ndarray, "pairs 5"]
) -> Float[np.ndarray, "pairs features"]:
    """Describe pairs of touching pieces, (pairs, PAIR_FEATURES), the larger piece first."""
    swap = pieces.sizes[pairs[:, 0]] < pieces.sizes[pairs[:, 1]]
    large, small = np.where(swap, pairs[:, 1], pairs[:, 0]), np.where(swap, pairs[:, 0], pairs[:, 1])
    low = np.minimum(pieces.low[large], pieces.low[small])
    high = np.maximum(pieces.high[large], pieces.high[small])
    offset = pieces.middle[small] - pieces.middle[large]
    shared = np.minimum(pieces.high[large], pieces.high[small]) - np.maximum(pieces.low[large], pieces.low[small])
    own = np.maximum(pieces.high[small] - pieces.low[small], 0.02)
    inside = (shared / own).clip(-1.0, 1.0)
    plan = np.sort(high[:, :2] - low[:, :2], axis=1)
    return np.column_stack(
        [
            *(pieces.features[large], pieces.features[small], contact),
            np.abs((pieces.normals[large] * pieces.normals[small]).sum(axis=1)),
            np.abs((pieces.normals[large] * offset).sum(axis=1)),
            np.abs((pieces.normals[small] * offset).sum(axis=1)),
            *(np.minimum(inside[:, 0], inside[:, 1]), inside[:, 2]),
            *(np.hypot(plan[:, 0], plan[:, 1]), high[:, 2] - low[:, 2]),
        ]
    )


def _means(values: np.ndarray, group: np.ndarray, counts: np.ndarray) -> np.ndarray:
    sums = [np.bincount(group, values[:, column], minlength=len(counts)) for column in range(values.shape[1])]
    return np.asarray(np.stack(sums, axis=1) / np.maximum(counts, 1)[:, None])
