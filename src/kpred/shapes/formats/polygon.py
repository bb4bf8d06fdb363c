"""Triangles of planar polygons, concave ones too."""

from __future__ import annotations

import numpy as np

from kpred.ops.typing import Float, Int

_MAX_CORNERS = 100_000
"""Corners of one polygon beyond which it is cut as a fan: clipping ears is quadratic on hostile outlines."""

_MAX_CLIPPED = 2_000_000
"""Sum of squared corners (in thousands) over all polygons of a file that are clipped; the others are cut as fans."""


def triangulate(
    vertices: Float[np.ndarray, "vertices 3"], corners: np.ndarray, sizes: np.ndarray
) -> tuple[Int[np.ndarray, "faces 3"], Int[np.ndarray, " faces"]]:
    """Cut many polygons into triangles, in their order.

    Args:
        vertices: (V, 3).
        corners: vertex indices of all polygons, one after the other.
        sizes: number of corners of each polygon.

    Returns:
        (F, 3) triangles and (F,) the polygon each one comes from; polygons of fewer than 3 corners give none.
    """
    starts = np.concatenate([[0], np.cumsum(sizes)]).astype(np.int64)
    three, four = np.flatnonzero(sizes == 3), np.flatnonzero(sizes == 4)
    blocks = [corners[starts[three][:, None] + np.arange(3)]]
    origins = [three]
    blocks.append(split_quads(vertices, corners[starts[four][:, None] + np.arange(4)]))
    origins.append(np.repeat(four, 2))
    spent = 0
    for polygon in np.flatnonzero(sizes > 4):
        outline = corners[starts[polygon] : starts[polygon + 1]]
        spent += len(outline) ** 2 // 1000
        cut = split_polygon(vertices, outline) if spent <= _MAX_CLIPPED else _fan(outline)
        blocks.append(cut)
        origins.append(np.full(len(cut), polygon))
    origin = np.concatenate(origins)
    order = np.argsort(origin, kind="stable")
    return np.concatenate(blocks)[order], origin[order]


def split_quads(vertices: Float[np.ndarray, "vertices 3"], quads: np.ndarray) -> Int[np.ndarray, "faces 3"]:
    """Split quads (Q, 4) into triangles (2 Q, 3), those of quad i in rows 2 i and 2 i + 1.

    A concave quad is cut along the diagonal that lies inside it.
    """
    a, b, c, d = (vertices[quads[:, k]] for k in range(4))
    with np.errstate(over="ignore", invalid="ignore"):
        folded = (np.cross(b - a, c - a) * np.cross(c - a, d - a)).sum(axis=1) < 0
    first = np.where(folded[:, None], quads[:, [0, 1, 3]], quads[:, [0, 1, 2]])
    second = np.where(folded[:, None], quads[:, [1, 2, 3]], quads[:, [0, 2, 3]])
    return np.stack([first, second], axis=1).reshape(-1, 3)


def split_polygon(
    vertices: Float[np.ndarray, "vertices 3"], corners: np.ndarray | list[int]
) -> Int[np.ndarray, "faces 3"]:
    """Triangulate one polygon (n,) to (n - 2, 3) by clipping ears; fewer if corners coincide.

    Seen along Newell's normal. A polygon without an area or with very many corners is cut as a fan.
    """
    outline = np.asarray(corners, dtype=np.int64)
    if len(outline) < 4 or len(outline) > _MAX_CORNERS:
        return _fan(outline)
    with np.errstate(over="ignore", invalid="ignore"):
        points = vertices[outline] - vertices[outline[0]]
        normal = np.cross(points, np.roll(points, -1, axis=0)).sum(axis=0)
    if not (np.isfinite(normal).all() and np.isfinite(points).all() and normal.any()):
        return _fan(outline)
    from mapbox_earcut import triangulate_float64

    drop = int(np.abs(normal).argmax())
    # Dropping the largest axis of the normal, and keeping its sign, makes the polygon counter-clockwise in the plane.
    keep = [(drop + 1) % 3, (drop + 2) % 3] if normal[drop] > 0 else [(drop + 2) % 3, (drop + 1) % 3]
    flat = np.ascontiguousarray(points[:, keep])
    found = triangulate_float64(flat, np.array([len(outline)], dtype=np.uint32)).astype(np.int64).reshape(-1, 3)
    if not len(found):
        return _fan(outline)
    a, b, c = (flat[found[:, k]] for k in range(3))
    flipped = (b[:, 0] - a[:, 0]) * (c[:, 1] - a[:, 1]) < (b[:, 1] - a[:, 1]) * (c[:, 0] - a[:, 0])
    return outline[np.where(flipped[:, None], found[:, ::-1], found)]


def _fan(outline: np.ndarray) -> np.ndarray:
    """Triangulate (n,) vertex indices around the first corner, (max(n - 2, 0), 3)."""
    count = max(len(outline) - 2, 0)
    first = np.full(count, outline[0] if count else 0, dtype=np.int64)
    return np.stack([first, outline[1 : count + 1], outline[2 : count + 2]], axis=1)
