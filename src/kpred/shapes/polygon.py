"""Triangles of planar polygons, concave ones too."""

from __future__ import annotations

import numpy as np

_LARGEST_CLIPPED = 1000


def triangulate(vertices: np.ndarray, corners: np.ndarray, sizes: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
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
    for polygon in np.flatnonzero(sizes > 4):
        cut = split_polygon(vertices, corners[starts[polygon] : starts[polygon + 1]].tolist())
        blocks.append(np.array(cut, dtype=np.int64))
        origins.append(np.full(len(cut), polygon))
    origin = np.concatenate(origins)
    order = np.argsort(origin, kind="stable")
    return np.concatenate(blocks)[order], origin[order]


def split_quads(vertices: np.ndarray, quads: np.ndarray) -> np.ndarray:
    """(Q, 4) vertex indices -> (2 Q, 3) triangles, those of quad i in rows 2 i and 2 i + 1.

    A concave quad is cut along the diagonal that lies inside it.
    """
    a, b, c, d = (vertices[quads[:, k]] for k in range(4))
    folded = (np.cross(b - a, c - a) * np.cross(c - a, d - a)).sum(axis=1) < 0
    first = np.where(folded[:, None], quads[:, [0, 1, 3]], quads[:, [0, 1, 2]])
    second = np.where(folded[:, None], quads[:, [1, 2, 3]], quads[:, [0, 2, 3]])
    return np.stack([first, second], axis=1).reshape(-1, 3)


def split_polygon(vertices: np.ndarray, corners: list[int]) -> list[tuple[int, int, int]]:
    """Vertex indices of one polygon (n corners) -> its n - 2 triangles, by clipping ears.

    Seen along Newell's normal. A polygon that crosses itself or has very many corners is cut as a fan.
    """
    fan = [(corners[0], corners[i], corners[i + 1]) for i in range(1, len(corners) - 1)]
    if len(corners) < 4 or len(corners) > _LARGEST_CLIPPED:
        return fan
    points = vertices[corners] - vertices[corners[0]]
    normal = np.cross(points, np.roll(points, -1, axis=0)).sum(axis=0)
    if not np.isfinite(normal).all() or not normal.any():
        return fan
    drop = int(np.abs(normal).argmax())
    # Dropping the largest axis of the normal, and keeping its sign, makes the polygon counter-clockwise in the plane.
    keep = [(drop + 1) % 3, (drop + 2) % 3] if normal[drop] > 0 else [(drop + 2) % 3, (drop + 1) % 3]
    flat = points[:, keep].tolist()
    left = list(range(len(corners)))
    triangles = []
    while len(left) > 3:
        for i in range(len(left)):
            before, here, after = left[i - 1], left[i], left[(i + 1) % len(left)]
            if _is_ear(flat, before, here, after, left):
                triangles.append((corners[before], corners[here], corners[after]))
                del left[i]
                break
        else:
            return fan
    return [*triangles, (corners[left[0]], corners[left[1]], corners[left[2]])]


def _is_ear(flat: list[list[float]], before: int, here: int, after: int, left: list[int]) -> bool:
    a, b, c = flat[before], flat[here], flat[after]
    if _turn(a, b, c) < 0:
        return False
    for other in left:
        p = flat[other]
        if other in (before, here, after) or p in (a, b, c):
            continue
        if _turn(a, b, p) >= 0 and _turn(b, c, p) >= 0 and _turn(c, a, p) >= 0:
            return False
    return True


def _turn(a: list[float], b: list[float], c: list[float]) -> float:
    return (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])
