"""Outliers of a cloud: exact repeats, strays, and small islands far from everything else."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components
from scipy.spatial import ConvexHull, QhullError, cKDTree

from kpred.ops.typing import Bool, Float, Int
from kpred.ops.worksharing import thread_count

NEIGHBOURS = 8
RANK = 5
"""A point's reach is the distance to its neighbour of this rank."""

SPARSE_RATIO, SPARSE_QUANTILE = 6.0, 0.65
"""Minimum reach of a stray, in multiples of this quantile of all reaches: a 36th of the density on a surface."""


def duplicate_points(points: Float[np.ndarray, "points 3"]) -> Bool[np.ndarray, " points"]:
    """Return a mask (N,) of points with exactly the coordinates of an earlier point."""
    bits = np.ascontiguousarray(points + 0.0).view(np.uint64)  # adding 0.0 makes -0.0 equal to 0.0
    with np.errstate(over="ignore"):
        key = bits[:, 0] * np.uint64(0x9E3779B97F4A7C15)
        key = (key ^ (key >> np.uint64(29)) ^ bits[:, 1]) * np.uint64(0xBF58476D1CE4E5B9)
        key = (key ^ (key >> np.uint64(32)) ^ bits[:, 2]) * np.uint64(0x94D049BB133111EB)
    order = np.argsort(key, kind="stable")
    # Equal rows have equal keys and so follow one another, the earliest first.
    repeats = (bits[order[1:]] == bits[order[:-1]]).all(axis=1)
    result = np.zeros(len(points), dtype=bool)
    result[order[1:]] = repeats
    return result


@dataclass(frozen=True)
class Neighbourhood:
    """Nearest neighbours of each point of a cloud, and the local spacing.

    Attributes:
        distance, index: (N, K) of the K nearest others, nearest first.
        reach: (N,) distance to the neighbour of rank 5.
        local: (N,) median reach of the neighbours: the local spacing.
    """

    distance: Float[np.ndarray, "points k"]
    index: Int[np.ndarray, "points k"]
    reach: Float[np.ndarray, " points"]
    local: Float[np.ndarray, " points"]


def neighbourhood(points: Float[np.ndarray, "points 3"]) -> Neighbourhood:
    """Compute the neighbourhood of at least ten points (N, 3)."""
    tree = cKDTree(points, balanced_tree=False, compact_nodes=False)
    distance, index = tree.query(points, k=min(NEIGHBOURS + 1, len(points)), workers=thread_count())
    reach = distance[:, min(RANK, distance.shape[1] - 1)]
    middle = index.shape[1] // 2
    local = np.partition(reach[index[:, 1:]], middle - 1, axis=1)[:, middle - 1]
    return Neighbourhood(distance[:, 1:], index[:, 1:], reach, local)


def stray_points(
    near: Neighbourhood, size: float, ratio: float, sparse_ratio: float = SPARSE_RATIO
) -> Bool[np.ndarray, " points"]:
    """Return a mask (N,) of points much farther from their neighbours than these are from theirs.

    Compared with the neighbours and not with the whole cloud, so that sparse surfaces stay. A point with nothing within
    a tenth of the scan's size, or in far sparser surroundings than most, as one of many strays, is also a stray.

    Args:
        ratio: minimum reach of a stray, in multiples of the neighbours' reach; sparse_ratio: of a large quantile of
            all reaches.
    """
    usual = float(np.median(near.reach))
    against_neighbours = (near.reach > ratio * near.local) & (near.reach > 0.5 * ratio * usual)
    against_most = near.reach > sparse_ratio * float(np.quantile(near.reach, SPARSE_QUANTILE))
    return against_neighbours | against_most | ((near.reach > 0.1 * size) & (near.reach > 2 * ratio * usual))


def island_points(
    points: Float[np.ndarray, "points 3"],
    near: Neighbourhood,
    alive: Bool[np.ndarray, " points"],
    up: Float[np.ndarray, "3"],
    size: float,
    speck: float,
    island: float,
) -> Bool[np.ndarray, " points"]:
    """Return a mask (N,) of small components, among points `alive`, far from the large ones.

    Specks (a fraction of at most `speck` of all points) are removed if they are four spacings and 4 % of the size away
    from anything larger. Islands (at most `island`) only if they also lie beside, above or far below the rest: a
    component below a seat or a top is probably a leg whose upper end was hidden.

    Args:
        up: unit vector.
        size: of the scan, in its units.
    """
    number = np.cumsum(alive) - 1
    count = int(alive.sum())
    linked = near.distance <= 3.0 * np.minimum(near.local[:, None], near.local[near.index])
    row, column = np.nonzero(linked & alive[:, None] & alive[near.index])
    ends = (number[row], number[near.index[row, column]])
    graph = coo_matrix((np.ones(len(row), dtype=np.int8), ends), shape=(count, count))
    _, label = connected_components(graph, directed=False)
    members = np.bincount(label)
    small = members <= max(3.0, island * count)
    result = np.zeros(len(points), dtype=bool)
    if not small.any() or small.all():
        return result
    points, local = points[alive], near.local[alive]
    large = ~small[label]
    large_points = points[large]
    candidates = np.flatnonzero(~large)
    distance, nearest = cKDTree(large_points).query(points[candidates])
    spacing = local[large][nearest]
    gap = np.full(len(members), np.inf)
    np.minimum.at(gap, label[candidates], distance)
    far = np.full(len(members), np.inf)
    np.minimum.at(far, label[candidates], distance / np.maximum(4.0 * spacing, 0.04 * size))
    sums = np.stack([np.bincount(label, points[:, axis]) for axis in range(3)], axis=1)
    centers = sums / members[:, None]
    away = _away_from(centers, large_points, up, size)
    is_speck = members <= max(3.0, speck * count)
    drop = small & (far > 1.0) & (is_speck | ((gap > 0.1 * size) & away))
    result[alive] = drop[label]
    return result


def _away_from(
    centers: np.ndarray, points: np.ndarray, up: np.ndarray, size: float, margin: float = 0.05
) -> Bool[np.ndarray, " centers"]:
    """Test whether centres lie beside the points' footprint, above them, or far below."""
    height, level = points @ up, centers @ up
    beside = outside_hull(plane_coordinates(centers, up), plane_coordinates(points, up)) > margin * size
    return beside | (level > height.max() + margin * size) | (level < height.min() - 0.4 * size)


def plane_axes(normal: Float[np.ndarray, "3"]) -> Float[np.ndarray, "2 3"]:
    """Return two unit vectors (2, 3), perpendicular to the normal and to each other."""
    x, y, z = normal.tolist()
    least = int(np.abs(normal).argmin())
    # Cross product of the normal and its least aligned axis; written out, since numpy's takes far longer.
    first = np.array([(0.0, z, -y), (-z, 0.0, x), (y, -x, 0.0)][least])
    first /= np.sqrt(first @ first)
    a, b, c = first.tolist()
    return np.array([first, (y * c - z * b, z * a - x * c, x * b - y * a)])


def plane_coordinates(points: Float[np.ndarray, "points 3"], normal: Float[np.ndarray, "3"]) -> np.ndarray:
    """Project points to coordinates (N, 2) along `plane_axes(normal)`."""
    coordinates: np.ndarray = points @ plane_axes(normal).T
    return coordinates


def outside_hull(queries: np.ndarray, points: np.ndarray) -> np.ndarray:
    """Return distances (N,) of queries (N, 2) from the convex hull of points (M, 2); negative inside.

    Near a corner it is the distance to the nearer edge's line, slightly less than that to the hull.
    """
    try:
        hull = ConvexHull(points)
    except (QhullError, ValueError):
        # Fewer than three points, or all on one line: the hull has no inside.
        if len(points) == 0:
            return np.full(len(queries), np.inf)
        distance: np.ndarray = cKDTree(points).query(queries)[0]
        return distance
    outside: np.ndarray = (queries @ hull.equations[:, :2].T + hull.equations[:, 2]).max(axis=1)
    return outside
