"""Planar facets of a mesh: connected coplanar faces, separate from the strips of a tessellated curved surface."""

from __future__ import annotations

import numpy as np
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components
from scipy.spatial import cKDTree

from kpred.ops.typing import Bool, Float, Int
from kpred.shapes.structure.edge_pairs import (
    FaceFrames,
    angles_between,
    direction_keys,
    edge_numbers,
    face_frames,
    line_angles,
    pairs_in_groups,
)
from kpred.shapes.structure.groups import group_spreads

WELD_TOLERANCE = 1e-5
"""Vertices nearer than this fraction of the mesh's longest side are one; faces less high than it have no area."""

FLAT_ANGLE = 0.1
"""Faces whose planes differ by less, in degrees, are coplanar."""

MAX_FLAT_ANGLE = 1.0
MAX_OFF_PLANE = 1e-4
"""Faces whose planes differ by less than this angle, in degrees, are coplanar too if the lower one leaves the other's
plane by less than this fraction of the mesh's longest side: boards that were rounded or decimated."""

SMOOTH_ANGLE = 31.0
"""Bends up to this angle, in degrees, may belong to a smooth surface: those of a cylinder of 12 sides do."""

MAX_WIDTH_RATIO = 3.0
"""A facet this many times wider than its neighbour across a bend is a plane beside a fillet, not a strip."""

MAX_BOW = 1e-3
"""Coplanar faces that spread off their plane by more than this fraction of their spread along it are curved."""

_PAIR_REACH = 3
_MAX_THIN_ROW = 256


def weld(vertices: Float[np.ndarray, "vertices 3"], tolerance: float) -> Int[np.ndarray, " vertices"]:
    """Return number the positions of vertices from 0 in order of appearance; those within a tolerance are one.

    In the unit of the vertices. Vertices nearer than an eighth of the tolerance are always one, vertices farther apart
    than twice the tolerance only where others between them connect them. With tolerance 0 equal positions are one.
    """
    if not len(vertices):
        return np.zeros(0, np.int64)
    positions = np.asarray(vertices, np.float64)
    # One vertex of each cell stands for all: of very dense ones, too, there are few pairs.
    cells = np.floor(positions / (tolerance / 4)) if tolerance > 0 else positions
    order = np.lexsort(cells.T)
    starts = np.concatenate([[True], (cells[order[1:]] != cells[order[:-1]]).any(axis=1)])
    cell_of = np.empty(len(order), np.int64)
    cell_of[order] = np.cumsum(starts) - 1
    if not tolerance > 0:
        return _in_order(cell_of)
    near = cKDTree(positions[order[starts]]).query_pairs(tolerance, output_type="ndarray")
    return _in_order(_components(near[:, 0], near[:, 1], int(starts.sum()))[cell_of])


def planar_facets(
    vertices: Float[np.ndarray, "vertices 3"], faces: Int[np.ndarray, "faces 3"]
) -> Int[np.ndarray, " faces"]:
    """Return number the planar facet of each face from 0 in order of appearance; -1 for curved surfaces.

    A facet is a largest set of coplanar faces that welded edges connect; winding does not matter. It is curved if it
    continues smoothly on at least two sides, at bends of up to `SMOOTH_ANGLE` towards facets that are not much
    narrower: the strips of a cylinder do, a plane beside its narrow fillet does not. So are the first and last strips
    of a curved surface, which continue towards such a facet on one side only; two planes that meet in one small bend
    are planar. A face without area belongs to the facet that it lies beside, if any, else to none (-1).
    """
    if not len(faces):
        return np.zeros(0, np.int64)
    corners = vertices[faces.reshape(-1)].astype(np.float64)
    size = float(np.ptp(corners, axis=0).max())
    if not 0 < size < np.inf:
        return np.full(len(faces), -1, np.int64)
    scaled = vertices.astype(np.float64) / size
    frames = face_frames(scaled, faces, WELD_TOLERANCE)
    edges = edge_numbers(weld(scaled, WELD_TOLERANCE)[faces])
    normals = _adopted_normals(frames, edges)
    first, second = pairs_in_groups(edges, np.repeat(direction_keys(normals), 3), _PAIR_REACH)
    left, right = first // 3, second // 3
    angle = line_angles(normals[left], normals[right])
    off_plane = np.radians(angle) * np.minimum(frames.heights[left], frames.heights[right])
    coplanar = (angle <= FLAT_ANGLE) | ((angle <= MAX_FLAT_ANGLE) & (off_plane <= MAX_OFF_PLANE))
    facets = _components(left[coplanar], right[coplanar], len(faces))
    # Where small bends add up, as in a finely tessellated fillet, only faces that are coplanar for certain are joined.
    coplanar &= (angle <= FLAT_ANGLE) | ~_bowed(scaled, faces, facets)[facets[left]]
    facets = _components(left[coplanar], right[coplanar], len(faces))
    area = np.bincount(facets, frames.areas)
    bend = angles_between(frames.inward[first], -frames.inward[second])
    smooth = ~coplanar & (bend <= SMOOTH_ANGLE) & (facets[left] != facets[right]) & (frames.areas[left] > 0)
    strips = _strips(facets[left[smooth]], facets[right[smooth]], frames.lengths[first[smooth]], area)
    curved: np.ndarray = strips | _bowed(scaled, faces, facets) | (area <= 0)
    planar = ~curved[facets]
    found = np.full(len(faces), -1, np.int64)
    found[planar] = _in_order(facets[planar])
    return found


def _adopted_normals(frames: FaceFrames, edges: np.ndarray) -> np.ndarray:
    """Compute normals (F, 3); a face of no area adopts that of its neighbour at its longest edge."""
    normals = frames.normals.copy()
    thin: np.ndarray = frames.areas <= 0
    if not thin.any():
        return normals
    pairs = pairs_in_groups(edges, np.repeat(thin.astype(np.float64), 3), _PAIR_REACH)
    first, second = np.concatenate(pairs), np.concatenate(pairs[::-1])
    # Of two long edges either will do; across a short one lies another facet, more often than not.
    longest = frames.lengths.reshape(-1, 3).max(axis=1)
    kept = np.flatnonzero(thin[first // 3] & (frames.lengths[first] > 0.9 * longest[first // 3]))
    kept = kept[np.argsort(frames.lengths[first[kept]], kind="stable")]
    face, neighbour = first[kept] // 3, second[kept] // 3
    for _ in range(_MAX_THIN_ROW):
        known = (normals != 0).any(axis=1)
        found = np.flatnonzero(~known[face] & known[neighbour])
        if not len(found):
            break
        normals[face[found]] = normals[neighbour[found]]
    return normals


def _strips(left: np.ndarray, right: np.ndarray, length: np.ndarray, area: np.ndarray) -> Bool[np.ndarray, " facets"]:
    """Test whether each facet is a strip of a curved surface, by facets that meet in smooth bends."""
    count = len(area)
    keys, index = np.unique(np.minimum(left, right) * count + np.maximum(left, right), return_inverse=True)
    shared = np.bincount(index.reshape(-1), length, len(keys))
    low, high = keys // count, keys % count
    facet, other = np.concatenate([low, high]), np.concatenate([high, low])
    # Facets of a pair meet along the same length: their areas are in the ratio of their widths.
    continues = (area[facet] <= MAX_WIDTH_RATIO * area[other]) & (np.concatenate([shared, shared]) > 0)
    facet, other = facet[continues], other[continues]
    found = np.bincount(facet, minlength=count) >= 2
    found[facet[found[other]]] = True
    return found


def _bowed(vertices: np.ndarray, faces: np.ndarray, facets: np.ndarray) -> Bool[np.ndarray, " facets"]:
    """Test whether each facet drifts off its plane: small bends that add up to a curved surface."""
    count = int(facets.max()) + 1
    # One or two coplanar triangles cannot add up to anything, and most facets are no more.
    several = np.bincount(facets, minlength=count) > 2
    inside = np.flatnonzero(several[facets])
    found = np.zeros(count, bool)
    if len(inside):
        number = np.cumsum(several) - 1
        corners = vertices[faces[inside].reshape(-1)]
        spreads = group_spreads(corners, np.repeat(number[facets[inside]], 3), int(several.sum()))
        found[several] = spreads[:, 0] > MAX_BOW * spreads[:, 2] + MAX_OFF_PLANE
    return found


def _components(first: np.ndarray, second: np.ndarray, count: int) -> np.ndarray:
    graph = coo_matrix((np.ones(len(first), np.int8), (first, second)), shape=(count, count))
    found: np.ndarray = connected_components(graph, directed=False)[1].astype(np.int64)
    return found


def _in_order(labels: np.ndarray) -> np.ndarray:
    """Return renumber labels from 0 by first appearance."""
    found, first, index = np.unique(labels, return_index=True, return_inverse=True)
    rank = np.empty(len(found), np.int64)
    rank[np.argsort(first)] = np.arange(len(found))
    ordered: np.ndarray = rank[index.reshape(-1)]
    return ordered
