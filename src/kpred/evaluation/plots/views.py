"""Small pictures of shapes in the unit box: meshes, points, keypoints and cages, all seen by one camera."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from kpred.ops.typing import Float, Int
from kpred.rendering.overlay import draw_overlay
from kpred.rendering.view import square_camera
from kpred.shapes.camera import Camera

_FOCAL = 2.4
REACH = 1.9
"""Radius of what fits into the picture, unit box."""

Picture = np.ndarray
"""(size, size, 3) uint8."""


def view(size: int, reach: float = REACH) -> Camera:
    """Make the camera, from the front, right and above; a ball of radius `reach` fills its `size` pixels."""
    return square_camera(np.zeros(3), _FOCAL * reach, _FOCAL, size)


def blank(size: int) -> Picture:
    """Make a white picture."""
    return np.full((size, size, 3), 255, dtype=np.uint8)


def mesh_picture(
    vertices: Float[np.ndarray, "vertices 3"],
    faces: Int[np.ndarray, "faces 3"],
    size: int,
    opacity: float = 1.0,
    reach: float = REACH,
) -> Picture:
    """Draw a shaded mesh with outlines; unit box."""
    return draw_overlay(blank(size), np.asarray(vertices), np.asarray(faces), view(size, reach), opacity)


def with_points(
    picture: Picture,
    points: Float[np.ndarray, "points 3"],
    colors: np.ndarray,
    radius: float = 1.0,
    reach: float = REACH,
) -> Picture:
    """Draw round dots on a picture, far ones first.

    Args:
        points: unit box; colors: (N, 3) or (3,) in [0, 1]; radius: pixels.
    """
    drawn = picture.copy()
    pixels, depth = view(len(picture), reach).project(np.asarray(points, dtype=np.float64))
    paint = np.broadcast_to(np.asarray(colors, dtype=np.float64), (len(points), 3))
    wide = int(np.ceil(radius))
    rows, columns = np.mgrid[-wide : wide + 1, -wide : wide + 1]
    inside = rows**2 + columns**2 <= radius**2
    for point in np.argsort(-depth, kind="stable"):
        row = np.round(pixels[point, 1]).astype(int) + rows[inside]
        column = np.round(pixels[point, 0]).astype(int) + columns[inside]
        seen = (row >= 0) & (row < len(drawn)) & (column >= 0) & (column < len(drawn))
        drawn[row[seen], column[seen]] = np.round(paint[point] * 255).astype(np.uint8)
    return drawn


def with_keypoints(picture: Picture, keypoints: Float[np.ndarray, "keypoints 3"], radius: float) -> Picture:
    """Draw one ringed dot for each keypoint, in a colour of its own, hidden ones too."""
    ringed = with_points(picture, keypoints, np.zeros(3), radius + 1.5)
    return with_points(ringed, keypoints, keypoint_colors(len(keypoints)), radius)


def keypoint_colors(count: int) -> Float[np.ndarray, "keypoints 3"]:
    """Colours around the circle of hues, neighbours in number far apart in hue."""
    from matplotlib import colormaps

    order = (np.arange(count) * 5) % count if count % 5 else np.arange(count)
    return np.asarray(colormaps["hsv"]((order + 0.5) / (count + 1)))[:, :3]


def with_lines(
    picture: Picture,
    points: Float[np.ndarray, "points 3"],
    edges: Sequence[tuple[int, int]],
    color: np.ndarray,
    reach: float = REACH,
) -> Picture:
    """Draw straight lines between points of these numbers; unit box, colour in [0, 1]."""
    from PIL import Image, ImageDraw

    canvas = Image.fromarray(picture)
    pen = ImageDraw.Draw(canvas)
    pixels = view(len(picture), reach).project(np.asarray(points, dtype=np.float64))[0]
    ink = tuple(int(round(255 * value)) for value in color)
    for one, other in edges:
        pen.line([tuple(pixels[one]), tuple(pixels[other])], fill=ink, width=1)
    return np.asarray(canvas)
