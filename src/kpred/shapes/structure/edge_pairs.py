"""Faces at the edges of a mesh: directions into the faces, and which faces meet, whatever their winding."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from kpred.ops.typing import Float, Int

# No symmetry: directions that are equal up to sign, and hardly any others, have equal products with it.
_GENERIC = np.array([0.5377, 0.2611, 0.8017])


@dataclass(frozen=True, eq=False)
class FaceFrames:
    """Geometry of F faces and of their half-edges: 3 f + k starts at corner k of face f.

    Attributes:
        normals: (F, 3) unit normals by winding; zero for faces of no area.
        areas: (F,); heights: (F,) over the longest edge, 0 for faces of no area.
        lengths: (3 F,) of the half-edges.
        directions: (3 F, 3) unit vectors along the half-edges; zero without length.
        inward: (3 F, 3) unit vectors in the face, perpendicular to the half-edge, into the face; zero for faces of no
            area.
    """

    normals: Float[np.ndarray, "faces 3"]
    areas: Float[np.ndarray, " faces"]
    heights: Float[np.ndarray, " faces"]
    lengths: Float[np.ndarray, " halfedges"]
    directions: Float[np.ndarray, "halfedges 3"]
    inward: Float[np.ndarray, "halfedges 3"]


def face_frames(
    vertices: Float[np.ndarray, "vertices 3"], faces: Int[np.ndarray, "faces 3"], min_height: float
) -> FaceFrames:
    """Compute the frames of faces, in the unit of the vertices.

    Args:
        min_height: faces that are less high over their longest edge have no area.
    """
    corners = vertices[faces].astype(np.float64)
    sides = corners[:, [1, 2, 0]] - corners
    lengths = np.sqrt(np.einsum("fki,fki->fk", sides, sides))
    cross = _cross(sides[:, 0], sides[:, 1])
    doubled = np.sqrt(np.einsum("fi,fi->f", cross, cross))
    heights = doubled / np.maximum(lengths.max(axis=1, initial=0.0), 1e-300)
    solid = heights > min_height
    normals = np.where(solid[:, None], cross / np.maximum(doubled, 1e-300)[:, None], 0.0)
    directions = sides / np.maximum(lengths, 1e-300)[:, :, None]
    return FaceFrames(
        normals=normals,
        areas=np.where(solid, doubled / 2, 0.0),
        heights=np.where(solid, heights, 0.0),
        lengths=lengths.reshape(-1),
        directions=directions.reshape(-1, 3),
        inward=_cross(normals[:, None], directions).reshape(-1, 3),
    )


def edge_numbers(corners: Int[np.ndarray, "faces 3"]) -> Int[np.ndarray, " halfedges"]:
    """Return number the edge of each half-edge by the welded corners of the faces; -1 for no length.

    Numbers are equal where the ends are, in either order; they are neither consecutive nor in any order.
    """
    ends = np.asarray(corners, np.int64)
    following = ends[:, [1, 2, 0]]
    low, high = np.minimum(ends, following), np.maximum(ends, following)
    numbers = np.where(low < high, low * (int(ends.max(initial=0)) + 1) + high, -1)
    return numbers.reshape(-1)


def pairs_in_groups(
    groups: Int[np.ndarray, " items"], keys: Float[np.ndarray, " items"], reach: int
) -> tuple[Int[np.ndarray, " pairs"], Int[np.ndarray, " pairs"]]:
    """Find pairs of items of one group, by index, at most `reach` ranks apart when sorted by key.

    All pairs of groups of up to `reach` + 1 items; of larger ones those of similar keys, so that the number of pairs is
    linear. Items of negative groups are left out.
    """
    order = np.lexsort((keys, groups))
    order = order[np.searchsorted(groups[order], 0) :]
    ordered = groups[order]
    first, second = [], []
    for step in range(1, reach + 1):
        same = np.flatnonzero(ordered[step:] == ordered[:-step])
        first.append(order[same])
        second.append(order[same + step])
    return np.concatenate(first), np.concatenate(second)


def direction_keys(directions: Float[np.ndarray, "items 3"]) -> Float[np.ndarray, " items"]:
    """Compute a key of each direction that is the same for parallel and opposite ones."""
    keys: np.ndarray = np.abs(directions @ _GENERIC)
    return keys


def angles_between(first: Float[np.ndarray, "pairs 3"], second: Float[np.ndarray, "pairs 3"]) -> np.ndarray:
    """Compute angles of unit vectors, (pairs,) degrees, exact for small ones; 90 if one is zero, 0 if both are."""
    apart, together = first - second, first + second
    squares = np.einsum("pi,pi->p", apart, apart), np.einsum("pi,pi->p", together, together)
    angles: np.ndarray = np.degrees(2.0 * np.arctan2(np.sqrt(squares[0]), np.sqrt(squares[1])))
    return angles


def line_angles(first: Float[np.ndarray, "pairs 3"], second: Float[np.ndarray, "pairs 3"]) -> np.ndarray:
    """Compute angles of unit vectors whose signs do not matter, (pairs,) degrees, 0 to 90."""
    angles = angles_between(first, second)
    return np.minimum(angles, 180.0 - angles)


def _cross(first: np.ndarray, second: np.ndarray) -> np.ndarray:
    # np.cross takes three times as long for short arrays.
    x, y, z = first[..., 0], first[..., 1], first[..., 2]
    u, v, w = second[..., 0], second[..., 1], second[..., 2]
    return np.stack([y * w - z * v, z * u - x * w, x * v - y * u], axis=-1)
