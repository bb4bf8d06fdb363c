"""What a deformation took from the edges of a mesh: straight lines, right angles, dihedral angles."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components

from kpred.ops.typing import Float, Int
from kpred.shapes.structure.edge_pairs import (
    FaceFrames,
    angles_between,
    direction_keys,
    edge_numbers,
    line_angles,
    pairs_in_groups,
)
from kpred.shapes.structure.facets import MAX_BOW, MAX_OFF_PLANE, SMOOTH_ANGLE
from kpred.shapes.structure.groups import group_spreads
from kpred.shapes.structure.weighted import weighted_mean, weighted_quantile

SQUARE_ANGLE = 1.0
"""Dihedral angles within so many degrees of 90 are right angles."""

COLLINEAR_ANGLE = 1.0
"""Edges that meet and are within so many degrees of each other lie on one line."""

_PAIR_REACH = 3


@dataclass(frozen=True)
class EdgeChanges:
    """Edge measures, as in `kpred.shapes.structure.cleanliness.Cleanliness`."""

    straightness: float
    squareness: float
    squareness_95: float
    dihedral_change: float


def measure_edges(
    source: Float[np.ndarray, "vertices 3"],
    result: Float[np.ndarray, "vertices 3"],
    faces: Int[np.ndarray, "faces 3"],
    frames: tuple[FaceFrames, FaceFrames],
    welded: Int[np.ndarray, " vertices"],
) -> EdgeChanges:
    """Measure the edges of a deformed mesh against its source, both in the unit box: fractions and degrees.

    Args:
        frames: of the faces in the source and in the result; welded: position of each vertex in the source.
    """
    before, after = frames
    edges = edge_numbers(welded[faces])
    first, second = pairs_in_groups(edges, np.repeat(direction_keys(before.normals), 3), _PAIR_REACH)
    solid = (before.areas > 0) & (after.areas > 0)
    measured = solid[first // 3] & solid[second // 3]
    lengths = np.where(measured, before.lengths[first], 0.0)
    angle = angles_between(before.inward[first], before.inward[second])
    change = np.abs(angles_between(after.inward[first], after.inward[second]) - angle)
    square = np.where(np.abs(angle - 90.0) <= SQUARE_ANGLE, lengths, 0.0)
    _, index, number = np.unique(edges, return_inverse=True, return_counts=True)
    faces_there = number[index.reshape(-1)]
    interior = np.where(faces_there[first] == 2, lengths, 0.0)
    opened = np.abs(_dihedral(after, first, second) - _dihedral(before, first, second))
    bent = line_angles(before.normals[first // 3], before.normals[second // 3]) > SMOOTH_ANGLE
    proper = (before.areas[first // 3] > 0) & (before.areas[second // 3] > 0)
    feature = np.concatenate([first[bent & proper], np.flatnonzero((faces_there == 1) & (edges >= 0))])
    return EdgeChanges(
        straightness=_straightness(source, result, faces, before, welded, np.isin(edges, edges[feature])),
        squareness=weighted_mean(change, square),
        squareness_95=weighted_quantile(change, square, 0.95),
        dihedral_change=weighted_mean(np.minimum(opened, 360.0 - opened), interior),
    )


def _dihedral(frames: FaceFrames, first: np.ndarray, second: np.ndarray) -> np.ndarray:
    """Compute signed dihedral angles in degrees, -180 to 180, by the first face's winding."""
    other = frames.inward[second]
    sine = np.einsum("pi,pi->p", other, frames.normals[first // 3])
    cosine = np.einsum("pi,pi->p", other, frames.inward[first])
    angles: np.ndarray = np.degrees(np.arctan2(sine, cosine))
    return angles


def _straightness(
    source: np.ndarray,
    result: np.ndarray,
    faces: np.ndarray,
    frames: FaceFrames,
    welded: np.ndarray,
    feature: np.ndarray,
) -> float:
    """Measure the mean RMS distance of collinear edge chains to their best lines, beyond the source's."""
    halves = np.flatnonzero(feature)
    if not len(halves):
        return 0.0
    ends = np.stack([faces.reshape(-1)[halves], faces[:, [1, 2, 0]].reshape(-1)[halves]], axis=1).astype(np.int64)
    _, one, edge = np.unique(edge_numbers(welded[faces])[halves], return_index=True, return_inverse=True)
    chain_of, count = _chains(welded[ends[one]], frames.directions[halves[one]])
    chain = chain_of[edge.reshape(-1)]
    pairs = np.unique(chain[:, None] * len(source) + ends)
    group, vertex = pairs // len(source), pairs % len(source)
    before, after = (group_spreads(vertices[vertex], group, count) for vertices in (source, result))
    off_line = np.hypot(before[:, 0], before[:, 1])
    # Small bends may add up, along the rim of a finely tessellated disc.
    straight = off_line <= MAX_BOW * before[:, 2] + MAX_OFF_PLANE
    lengths = np.bincount(chain_of, frames.lengths[halves[one]], count)
    loss = np.maximum(np.hypot(after[:, 0], after[:, 1]) - off_line, 0.0)
    return weighted_mean(loss, np.where(straight, lengths, 0.0))


def _chains(ends: np.ndarray, directions: np.ndarray) -> tuple[np.ndarray, int]:
    """Return number the chain of each edge: edges that meet and are collinear are one chain; also their count."""
    keys = direction_keys(directions)
    first, second = pairs_in_groups(ends.reshape(-1), np.repeat(keys, 2), _PAIR_REACH)
    first, second = first // 2, second // 2
    collinear = line_angles(directions[first], directions[second]) <= COLLINEAR_ANGLE
    graph = coo_matrix(
        (np.ones(int(collinear.sum()), np.int8), (first[collinear], second[collinear])), shape=(len(ends), len(ends))
    )
    count, chain = connected_components(graph, directed=False)
    return chain.astype(np.int64), int(count)
