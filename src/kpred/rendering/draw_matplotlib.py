"""Draws a `Scene` with matplotlib, which needs no graphics library: the fall-back of `draw_pyvista`."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from kpred.rendering.picture import PICTURE_SIZE, VIEW_DIRECTION, Scene

_DPI = 100
_LIGHT = np.array([0.45, 0.75, 0.55])


def draw_scene(scene: Scene, path: Path) -> None:
    """Write the scene's three panels to the PNG `path`."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.collections import PolyCollection
    from matplotlib.figure import Figure

    figure = Figure(figsize=(PICTURE_SIZE[0] / _DPI, PICTURE_SIZE[1] / _DPI), dpi=_DPI, facecolor="white")
    FigureCanvasAgg(figure)
    center, radius = scene.camera()
    points = _project(scene.scan, center)
    for column in range(3):
        axes: Any = figure.add_axes((column / 3, 0.0, 1 / 3, 0.92))
        axes.set_axis_off()
        axes.set_aspect("equal")
        axes.set_xlim(-radius, radius)
        axes.set_ylim(-radius, radius)
        axes.set_title(str(scene.titles[column]), color="#333333", fontsize=13)
        if column == 0:
            axes.scatter(points[:, 0], points[:, 1], c=scene.scan[:, 1], s=3, cmap="viridis", linewidths=0)
            continue
        vertices, faces, color = (
            (scene.retrieved_vertices, scene.retrieved_faces, (0.73, 0.77, 0.82))
            if column == 1
            else (scene.result_vertices, scene.result_faces, (0.44, 0.62, 0.85))
        )
        # Painter's order: far triangles first.
        corners = _project(vertices, center)[faces]
        order = np.argsort(corners[:, :, 2].mean(axis=1))
        shades = np.outer(_brightness(vertices[faces]), color).clip(0, 1)[order]
        polygons = PolyCollection(list(corners[order, :, :2]), facecolors=shades, edgecolors=shades, linewidths=0.3)
        axes.add_collection(polygons, autolim=False)
        if column == 2:
            axes.scatter(points[:, 0], points[:, 1], c="#d1495b", s=1.2, linewidths=0, alpha=0.7, zorder=3)
    figure.savefig(path, dpi=_DPI)


def _project(points: np.ndarray, center: np.ndarray) -> np.ndarray:
    """(N, 3): right, up and toward the eye, parallel projection."""
    toward = np.asarray(VIEW_DIRECTION) / np.linalg.norm(VIEW_DIRECTION)
    right = np.cross([0.0, 1.0, 0.0], toward)
    right /= np.linalg.norm(right)
    return (points.astype(np.float64) - center) @ np.stack([right, np.cross(toward, right), toward], axis=1)


def _brightness(triangles: np.ndarray) -> np.ndarray:
    """(F,) of triangles (F, 3, 3); both sides of a face are lit alike, as winding is not reliable."""
    normals = np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0]).astype(np.float64)
    length = np.linalg.norm(normals, axis=1)
    cosine = np.abs(normals @ (_LIGHT / np.linalg.norm(_LIGHT))) / np.where(length > 0, length, 1.0)
    return 0.55 + 0.5 * cosine
