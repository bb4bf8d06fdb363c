"""Thumbnails of meshes: small pictures from the front, side and above; they need no graphics library."""

from __future__ import annotations

import numpy as np
from PIL import Image

from kpred.ops.typing import Float, Int, UInt8
from kpred.rendering.overlay import draw_overlay
from kpred.rendering.view import square_camera

FINE = 2
"""They are drawn so many times as large, for thin outlines."""

_FOCAL = 2.2


def draw_thumbnail(
    vertices: Float[np.ndarray, "vertices 3"], faces: Int[np.ndarray, "faces 3"], side: int
) -> UInt8[np.ndarray, "side side 3"]:
    """Draw a mesh (y up, front +z, any unit) on white, `side` pixels wide and high."""
    low, high = vertices.min(axis=0), vertices.max(axis=0)
    radius = float(np.linalg.norm(high - low)) / 2 or 1.0
    camera = square_camera((low + high) / 2, _FOCAL * radius * 1.2, _FOCAL, FINE * side)
    canvas = np.full((FINE * side, FINE * side, 3), 255, np.uint8)
    drawn = draw_overlay(canvas, vertices, faces, camera, 1.0)
    return np.asarray(Image.fromarray(drawn).resize((side, side), Image.Resampling.LANCZOS))
