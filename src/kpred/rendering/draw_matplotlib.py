"""Draws a view with matplotlib, which needs no graphics library: plainer, by parallel projection."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from kpred.ops.typing import Float
from kpred.rendering.view import Layer, Panel, View, eye_axes

_DPI = 100
_LIGHT = np.array([0.45, 0.75, 0.55])
_TITLES = 0.92
"""Panels take this fraction of the height; titles stand above."""

_MAX_POINTS = 120_000


def draw_plainly(view: View, path: Path) -> None:
    """Write a view to the PNG `path`."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    width, height = view.size
    figure = Figure(figsize=(width / _DPI, height / _DPI), dpi=_DPI, facecolor="white")
    FigureCanvasAgg(figure)
    share = 1 / len(view.panels)
    reach = view.radius / view.closeness
    shape = height * _TITLES / (width * share)
    for column, panel in enumerate(view.panels):
        axes: Any = figure.add_axes((column * share, 0.0, share, _TITLES))
        axes.set_axis_off()
        axes.set_aspect("equal")
        axes.set_xlim(-reach / min(shape, 1.0), reach / min(shape, 1.0))
        axes.set_ylim(-reach * max(shape, 1.0), reach * max(shape, 1.0))
        axes.set_title(panel.title, color="#333333", fontsize=13)
        _draw_panel(axes, panel, view)
    figure.savefig(path, dpi=_DPI)


def _draw_panel(axes: Any, panel: Panel, view: View) -> None:
    for order, layer in enumerate(panel.layers):
        if len(layer.faces) and layer.style.lit:
            _draw_mesh(axes, layer, view, order)
        elif len(layer.vertices):
            _draw_points(axes, layer, view, order)
    for name, place in zip(panel.labels, _project(panel.anchors, view), strict=True):
        axes.text(place[0], place[1], name, fontsize=8, color="#222222", ha="center", zorder=len(panel.layers) + 1)


def _draw_points(axes: Any, layer: Layer, view: View, order: int) -> None:
    """Draw points, far ones first; of meshes without shading their vertices."""
    step = max(1, -(-len(layer.vertices) // _MAX_POINTS))
    points = layer.vertices[::step]
    flat = _project(points, view)
    rows = np.argsort(flat[:, 2])
    size = (layer.style.point_size / 5.0) ** 2
    look: dict[str, Any] = {"s": size, "linewidths": 0, "alpha": layer.style.opacity, "zorder": order}
    if not len(layer.colors):
        look |= {"c": points[rows, 1], "cmap": "viridis"}
    elif len(layer.colors) == 1:
        look |= {"color": layer.colors[0] / 255.0}
    else:
        look |= {"c": layer.colors[::step][rows] / 255.0}
    axes.scatter(flat[rows, 0], flat[rows, 1], **look)


def _draw_mesh(axes: Any, layer: Layer, view: View, order: int) -> None:
    """Draw shaded triangles, far ones first."""
    from matplotlib.collections import PolyCollection

    corners = _project(layer.vertices, view)[layer.faces]
    rows = np.argsort(corners[:, :, 2].mean(axis=1))
    colors = np.broadcast_to(layer.colors / 255.0, (len(layer.faces), 3))
    shades = (_brightness(layer.vertices[layer.faces])[:, None] * colors).clip(0, 1)[rows]
    polygons = PolyCollection(list(corners[rows, :, :2]), facecolors=shades, edgecolors=shades, linewidths=0.3)
    polygons.set_zorder(order)
    axes.add_collection(polygons, autolim=False)


def _project(points: Float[np.ndarray, "points 3"], view: View) -> Float[np.ndarray, "points 3"]:
    """Project to the right, up and toward the eye."""
    projected: np.ndarray = (points.astype(np.float64) - view.center) @ eye_axes(view.direction).T
    return projected


def _brightness(triangles: Float[np.ndarray, "faces 3 3"]) -> Float[np.ndarray, " faces"]:
    """Compute brightness; both sides of a face are lit alike, as winding is not reliable."""
    normals = np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0]).astype(np.float64)
    length = np.linalg.norm(normals, axis=1)
    cosine = np.abs(normals @ (_LIGHT / np.linalg.norm(_LIGHT))) / np.where(length > 0, length, 1.0)
    shade: np.ndarray = 0.55 + 0.5 * cosine
    return shade
