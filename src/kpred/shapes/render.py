"""A virtual depth camera: which face each pixel of a picture shows, and how deep it lies. Plain numpy, exact."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from kpred.ops.typing import Float, Int
from kpred.shapes.camera import Camera

NEAR = 1e-3
"""What lies nearer than this fraction of the farthest depth is cut away, since it cannot be projected."""

_PIXELS_AT_ONCE = 4_000_000
_TOUCHING = 1e-7
"""Pixels by which faces reach beyond their edges, so that rounding leaves no cracks between them."""


def render_depth(
    vertices: Float[np.ndarray, "vertices 3"], faces: Int[np.ndarray, "faces 3"], camera: Camera
) -> Float[np.ndarray, "height width"]:
    """Render the depth picture (height, width) of a mesh.

    Args:
        vertices: (V, 3) in the camera's world, in any unit; faces: (F, 3), seen from both sides.

    Returns:
        (height, width) float64 depth along the viewing axis at the centres of the pixels, in the unit of the vertices;
        0 where nothing is seen, as depth sensors write it.
    """
    depth, face = render_faces(vertices, faces, camera)
    return np.where(face >= 0, depth, 0.0)


def render_faces(
    vertices: Float[np.ndarray, "vertices 3"], faces: Int[np.ndarray, "faces 3"], camera: Camera
) -> tuple[Float[np.ndarray, "height width"], Int[np.ndarray, "height width"]]:
    """Render depth (height, width) float64, infinite where nothing is seen, and the visible face, -1 for none."""
    corners, owner = _in_front(camera.to_camera(vertices), np.asarray(faces, dtype=np.int64))
    inverse = np.zeros(camera.height * camera.width)
    seen = np.full(len(inverse), -1, dtype=np.int64)
    if len(corners):
        plane = (corners / corners[..., 2:]) @ camera.intrinsics[:2].T
        for triangle, row, first, count in _spans(plane, camera.width, camera.height):
            _draw(plane, 1 / corners[..., 2], triangle, row, first, count, camera.width, owner, inverse, seen)
    with np.errstate(divide="ignore"):
        depth = 1 / inverse
    return depth.reshape(camera.height, camera.width), seen.reshape(camera.height, camera.width)


def _in_front(local: np.ndarray, faces: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Clip triangles (T, 3, 3) in camera axes at the near plane; also return their faces (T,)."""
    corners = local[faces].reshape(-1, 3, 3)
    depth = corners[..., 2]
    near = NEAR * float(depth.max(initial=0.0))
    before = depth > near
    inside = before.sum(axis=1)
    owner = np.arange(len(faces))
    parts, owners = [corners[inside == 3]], [owner[inside == 3]]
    for count in (1, 2):
        cut = corners[inside == count]
        if not len(cut) or near <= 0:
            continue
        # Turn the corner that is alone on its side to the front; the plane cuts the two edges that leave it.
        alone = (before[inside == count] if count == 1 else ~before[inside == count]).argmax(axis=1)
        shift = (alone[:, None] + np.arange(3)) % 3
        a, b, c = np.moveaxis(np.take_along_axis(cut, shift[..., None], axis=1), 1, 0)
        ab, ac = (a + (other - a) * ((near - a[:, 2:]) / (other[:, 2:] - a[:, 2:])) for other in (b, c))
        pieces = [(a, ab, ac)] if count == 1 else [(ab, b, c), (ab, c, ac)]
        parts += [np.stack(piece, axis=1) for piece in pieces]
        owners += [owner[inside == count]] * len(pieces)
    return np.concatenate(parts), np.concatenate(owners)


def _spans(plane: np.ndarray, width: int, height: int) -> Iterator[tuple[np.ndarray, ...]]:
    """Yield pixel runs within triangles: (triangle, row, first column, count), in bounded portions."""
    lowest, highest = plane[..., 1].min(axis=1), plane[..., 1].max(axis=1)
    top = np.ceil(np.clip(lowest - _TOUCHING, -1, height)).astype(np.int64).clip(0)
    rows = (np.floor(np.clip(highest + _TOUCHING, -1, height)).astype(np.int64).clip(max=height - 1) - top + 1).clip(0)
    # Edge functions a u + b v + c, positive inside whatever the winding.
    following = np.roll(plane, -1, axis=1)
    a = plane[..., 1] - following[..., 1]
    b = following[..., 0] - plane[..., 0]
    c = -(a * plane[..., 0] + b * plane[..., 1])
    sign = np.sign(_doubled_area(plane))[:, None]
    a, b, c = a * sign, b * sign, c * sign
    rows[sign[:, 0] == 0] = 0
    for part in _portions(rows, _PIXELS_AT_ONCE // 8):
        triangle = np.repeat(part, rows[part])
        row = top[triangle] + _counting(rows[part])
        rest = b[triangle] * row[:, None] + c[triangle]
        slope = a[triangle]
        with np.errstate(divide="ignore", invalid="ignore"):
            crossing = -rest / slope
        left = np.where(slope > 0, crossing, -np.inf).max(axis=1)
        right = np.where(slope < 0, crossing, np.inf).min(axis=1)
        beyond = ((slope == 0) & (rest < 0)).any(axis=1)
        first = np.ceil(np.clip(left - _TOUCHING, -1, width)).astype(np.int64).clip(0)
        count = np.floor(np.clip(right + _TOUCHING, -1, width)).astype(np.int64).clip(max=width - 1) - first + 1
        count = np.where(beyond, 0, count).clip(0)
        for run in _portions(count, _PIXELS_AT_ONCE):
            yield triangle[run], row[run], first[run], count[run]


def _draw(
    plane: np.ndarray,
    inverse_corners: np.ndarray,
    triangle: np.ndarray,
    row: np.ndarray,
    first: np.ndarray,
    count: np.ndarray,
    width: int,
    owner: np.ndarray,
    inverse: np.ndarray,
    seen: np.ndarray,
) -> None:
    """Write the runs where they are nearer than what is there; `inverse` depth and `seen` are (height * width,)."""
    # In the picture the inverse depth is linear over a triangle.
    origin, values = plane[triangle, 0], inverse_corners[triangle]
    u, v = plane[triangle, 1] - origin, plane[triangle, 2] - origin
    steps = values[:, 1:] - values[:, :1]
    area = u[:, 0] * v[:, 1] - u[:, 1] * v[:, 0]
    across = (steps[:, 0] * v[:, 1] - steps[:, 1] * u[:, 1]) / area
    down = (steps[:, 1] * u[:, 0] - steps[:, 0] * v[:, 0]) / area
    start = values[:, 0] + across * (first - origin[:, 0]) + down * (row - origin[:, 1])
    along = _counting(count)
    value = np.repeat(start, count) + np.repeat(across, count) * along
    # Rounding at a sliver's edge must not reach beyond its corners.
    value = value.clip(np.repeat(values.min(axis=1), count), np.repeat(values.max(axis=1), count))
    pixel = np.repeat(row * width + first, count) + along
    np.maximum.at(inverse, pixel, value)
    shown = value == inverse[pixel]
    seen[pixel[shown]] = np.repeat(owner[triangle], count)[shown]


def _doubled_area(plane: np.ndarray) -> np.ndarray:
    u, v = plane[:, 1] - plane[:, 0], plane[:, 2] - plane[:, 0]
    return u[:, 0] * v[:, 1] - u[:, 1] * v[:, 0]


def _counting(counts: np.ndarray) -> np.ndarray:
    """Return 0 .. n-1 for each n of `counts`, concatenated."""
    return np.arange(int(counts.sum())) - np.repeat(np.cumsum(counts) - counts, counts)


def _portions(sizes: np.ndarray, max_pixels: int) -> Iterator[np.ndarray]:
    """Yield rows with sizes > 0, in portions whose sizes add up to about `max_pixels`."""
    used = np.flatnonzero(sizes > 0)
    portion = np.cumsum(sizes[used]) // max_pixels
    for rows in np.split(used, np.flatnonzero(np.diff(portion)) + 1):
        if len(rows):
            yield rows
