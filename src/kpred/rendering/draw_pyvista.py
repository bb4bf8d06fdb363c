"""Draws the arrays of a `View` with pyvista, off-screen: `python draw_pyvista.py VIEW.npz PICTURE.png`.

Without arguments it draws what the lines of standard input name, until that ends (`drawing_process.py`).

Run by path in a process of its own, so that it loads nothing of kpred.
"""

from __future__ import annotations

import json
import os
import sys
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

_LIGHTS = ((-0.9, 1.1, 1.0), (1.2, 0.2, 0.9), (0.0, 0.0, 1.0))
"""Places of key, fill and head light, seen from the eye (right, up, toward the eye)."""

_TEXT = "#333333"


def draw(arrays: Mapping[str, np.ndarray], path: Path) -> None:
    """Write a view as PNG. Needs pyvista and a graphics library (EGL, OSMesa or X).

    Args:
        arrays: of `kpred.rendering.view.View.to_arrays`.
    """
    import pyvista as pv
    from vtkmodules.vtkCommonCore import vtkLogger

    # VTK tries X first and complains before it goes on to EGL: that is no news on a machine without a screen.
    vtkLogger.SetStderrVerbosity(vtkLogger.VERBOSITY_OFF)
    pv.OFF_SCREEN = True
    view = json.loads(str(arrays["view"]))
    panels = view["panels"]
    plotter = pv.Plotter(
        off_screen=True, shape=(1, len(panels)), window_size=view["size"], border=False, lighting="none"
    )
    plotter.set_background("white", all_renderers=True)
    direction = np.array(view["direction"]) / np.linalg.norm(view["direction"])
    lift = (direction * 0.012 * view["radius"]).astype(np.float32)
    for number, panel in enumerate(panels):
        plotter.subplot(0, number)
        for place, style in enumerate(panel["layers"]):
            vertices, faces, colors = (arrays[f"{number}.{place}.{name}"] for name in ("vertices", "faces", "colors"))
            if len(vertices):
                _add_layer(plotter, vertices + lift if style["lifted"] else vertices, faces, colors, style)
        if panel["labels"]:
            _add_labels(plotter, arrays[f"{number}.anchors"], panel["labels"])
        plotter.add_text(panel["title"], position="upper_edge", font_size=view["font_size"], color=_TEXT)
        _set_up(plotter, view, arrays["center"], direction)
    plotter.enable_anti_aliasing("ssaa", all_renderers=True)
    plotter.screenshot(str(path))
    plotter.close()


def _add_layer(
    plotter: Any, vertices: np.ndarray, faces: np.ndarray, colors: np.ndarray, style: Mapping[str, Any]
) -> None:
    import pyvista as pv

    shape = pv.PolyData.from_regular_faces(vertices, faces) if len(faces) else pv.PolyData(vertices)
    look: dict[str, Any] = {"show_scalar_bar": False}
    if not len(colors):
        shape.point_data["height"] = vertices[:, 1]
        look |= {"scalars": "height", "cmap": "viridis"}
    elif len(colors) == 1:
        look |= {"color": "#" + bytes(colors[0]).hex()}
    else:
        data = shape.cell_data if len(faces) and len(colors) == len(faces) else shape.point_data
        data["rgb"] = colors
        look |= {"scalars": "rgb", "rgb": True}
    if style["smooth"]:
        look |= {"smooth_shading": True, "split_sharp_edges": True, "feature_angle": 35.0}
    if len(faces) and style["lit"]:
        look |= {"ambient": style["ambient"], "diffuse": style["diffuse"], "specular": 0.05}
    plotter.add_mesh(
        shape,
        point_size=style["point_size"],
        render_points_as_spheres=style["balls"],
        opacity=style["opacity"],
        lighting=style["lit"],
        culling="back" if style["one_sided"] else None,
        **look,
    )


def _add_labels(plotter: Any, anchors: np.ndarray, labels: list[str]) -> None:
    plotter.add_point_labels(
        anchors, labels, font_size=16, text_color="#222222", shape=None, show_points=False, always_visible=True
    )


def _set_up(plotter: Any, view: Mapping[str, Any], center: np.ndarray, direction: np.ndarray) -> None:
    """Set lights and camera of one panel."""
    import pyvista as pv

    for place, strength in zip(_LIGHTS, view["lights"], strict=True):
        light = pv.Light(position=place, focal_point=(0, 0, 0), light_type="camera light", intensity=strength)
        plotter.add_light(light)
    distance = view["radius"] / np.sin(np.radians(view["angle"] / 2)) / view["closeness"]
    plotter.camera.position = tuple(center + direction * distance)
    plotter.camera.focal_point = tuple(center)
    plotter.camera.up = (0.0, 1.0, 0.0)
    plotter.camera.view_angle = view["angle"]
    plotter.reset_camera_clipping_range()


def _draw_file(file: str, picture: str) -> None:
    with np.load(file) as loaded:
        draw(dict(loaded), Path(picture))


def _draw_all() -> None:
    """Draw `VIEW TAB PICTURE` of each line of standard input, and print "done" after each."""
    # What libraries print must not be taken for an answer.
    answers = os.fdopen(os.dup(1), "w")
    os.dup2(2, 1)
    for line in sys.stdin:
        file, _, picture = line.rstrip("\n").partition("\t")
        _draw_file(file, picture)
        print("done", file=answers, flush=True)


if __name__ == "__main__":
    if len(sys.argv) > 1:
        _draw_file(sys.argv[1], sys.argv[2])
    else:
        _draw_all()
