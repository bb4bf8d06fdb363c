"""Draws the arrays of a `SceneView` with pyvista: `python draw_scene_pyvista.py SCENE.npz PICTURE.png`.

Run by path in a process of its own, so that it loads nothing of kpred.
"""

from __future__ import annotations

import sys
from collections.abc import Mapping
from pathlib import Path

import numpy as np

_VIEW_ANGLE = 28.0
_FAINT = "#d5d9de"
_LIGHTS = (((-0.9, 1.1, 1.0), 0.4), ((1.2, 0.2, 0.9), 0.15), ((0.0, 0.0, 1.0), 0.15))
"""Key, fill and head light: place seen from the eye (right, up, toward the eye) and strength."""


def draw_scene(scene: Mapping[str, np.ndarray], path: Path) -> None:
    """Write the two panels to the PNG `path`. Needs pyvista and a graphics library (EGL, OSMesa or X).

    Args:
        scene: the arrays of a `kpred.rendering.scene_picture.SceneView` by name, and center (3,), radius (), direction
            (3,) of the camera and size (2,) of the picture in pixels.
    """
    import pyvista as pv
    from vtkmodules.vtkCommonCore import vtkLogger

    # VTK tries X first and complains before it goes on to EGL: that is no news on a machine without a screen.
    vtkLogger.SetStderrVerbosity(vtkLogger.VERBOSITY_OFF)
    pv.OFF_SCREEN = True
    plotter = pv.Plotter(
        off_screen=True, shape=(1, 2), window_size=[int(side) for side in scene["size"]], border=False, lighting="none"
    )
    plotter.set_background("white", all_renderers=True)
    center, radius = scene["center"], float(scene["radius"])
    direction = scene["direction"] / np.linalg.norm(scene["direction"])
    eye = center + direction * radius / np.sin(np.radians(_VIEW_ANGLE / 2)) * 0.88
    if len(scene["scan_faces"]):
        scan = pv.PolyData.from_regular_faces(scene["points"], scene["scan_faces"])
    else:
        scan = pv.PolyData(scene["points"])
    scan.point_data["rgb"] = scene["colors"]
    for column in range(2):
        plotter.subplot(0, column)
        is_mesh = bool(len(scene["scan_faces"]))
        # Near walls are seen from behind: left out, they hide nothing.
        culling = "back" if bool(scene["one_sided"]) else None
        if column == 0:
            # Colours of a scan hold its light already.
            plotter.add_mesh(scan, scalars="rgb", rgb=True, lighting=False, point_size=4, culling=culling)
        else:
            opacity = 0.3 if is_mesh else 0.5
            plotter.add_mesh(scan, color=_FAINT, opacity=opacity, lighting=False, point_size=2, culling=culling)
            if len(scene["faces"]):
                models = pv.PolyData.from_regular_faces(scene["vertices"], scene["faces"])
                models.cell_data["rgb"] = scene["face_colors"]
                plotter.add_mesh(models, scalars="rgb", rgb=True, ambient=0.25, diffuse=0.8, specular=0.05)
                plotter.add_point_labels(
                    scene["anchors"],
                    [str(name) for name in scene["labels"]],
                    font_size=16,
                    text_color="#222222",
                    shape=None,
                    show_points=False,
                    always_visible=True,
                )
        for place, strength in _LIGHTS:
            plotter.add_light(
                pv.Light(position=place, focal_point=(0, 0, 0), light_type="camera light", intensity=strength)
            )
        plotter.add_text(str(scene["titles"][column]), position="upper_edge", font_size=12, color="#333333")
        plotter.camera.position = tuple(eye)
        plotter.camera.focal_point = tuple(center)
        plotter.camera.up = (0.0, 1.0, 0.0)
        plotter.camera.view_angle = _VIEW_ANGLE
        plotter.reset_camera_clipping_range()
    plotter.enable_anti_aliasing("ssaa", all_renderers=True)
    plotter.screenshot(str(path))
    plotter.close()


if __name__ == "__main__":
    with np.load(sys.argv[1]) as arrays:
        draw_scene(dict(arrays), Path(sys.argv[2]))
