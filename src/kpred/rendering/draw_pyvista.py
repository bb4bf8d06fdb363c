"""Draws a saved scene with pyvista, off-screen: ``python draw_pyvista.py SCENE.npz PICTURE.png``.

Run by `kpred.rendering.picture` as a program of its own, so it imports nothing of kpred.
"""

from __future__ import annotations

import sys
from collections.abc import Mapping
from pathlib import Path

import numpy as np

_RETRIEVED, _RESULT, _POINTS = "#b9c4d0", "#6f9fd8", "#d1495b"
_VIEW_ANGLE = 26.0
_LIGHTS = (((-0.9, 1.1, 1.0), 0.36), ((1.2, 0.2, 0.9), 0.14), ((0.0, 0.0, 1.0), 0.12))
"""Key, fill and head light: place seen from the eye (right, up, toward the eye) and strength."""


def draw_scene(scene: Mapping[str, np.ndarray], path: Path) -> None:
    """Write the scene's three panels to the PNG `path`. Needs pyvista and a graphics library (EGL, OSMesa or X).

    Args:
        scene: the arrays of a `kpred.rendering.picture.Scene` by name, and center (3,), radius (), direction (3,) of
            the camera and size (2,) of the picture in pixels.
    """
    import pyvista as pv
    from vtkmodules.vtkCommonCore import vtkLogger

    # VTK tries X first and complains before it goes on to EGL: that is no news on a machine without a screen.
    vtkLogger.SetStderrVerbosity(vtkLogger.VERBOSITY_OFF)
    pv.OFF_SCREEN = True
    plotter = pv.Plotter(
        off_screen=True, shape=(1, 3), window_size=[int(side) for side in scene["size"]], border=False, lighting="none"
    )
    plotter.set_background("white", all_renderers=True)
    center, radius = scene["center"], float(scene["radius"])
    direction = scene["direction"] / np.linalg.norm(scene["direction"])
    eye = center + direction * radius / np.sin(np.radians(_VIEW_ANGLE / 2)) * 1.05
    toward = (direction * 0.012 * radius).astype(np.float32)  # lifts the overlaid points off the surface they lie in

    height = scene["scan"][:, 1]
    retrieved = pv.PolyData.from_regular_faces(scene["retrieved_vertices"], scene["retrieved_faces"])
    result = pv.PolyData.from_regular_faces(scene["result_vertices"], scene["result_faces"])
    for column in range(3):
        plotter.subplot(0, column)
        if column == 0:
            plotter.add_points(
                scene["scan"],
                scalars=height,
                cmap="viridis",
                point_size=9,
                render_points_as_spheres=True,
                show_scalar_bar=False,
            )
        else:
            plotter.add_mesh(
                retrieved if column == 1 else result,
                color=_RETRIEVED if column == 1 else _RESULT,
                smooth_shading=True,
                split_sharp_edges=True,
                feature_angle=35.0,
                ambient=0.2,
                diffuse=0.85,
                specular=0.05,
            )
        if column == 2:
            plotter.add_points(scene["scan"] + toward, color=_POINTS, point_size=5, render_points_as_spheres=True)
        for place, strength in _LIGHTS:
            plotter.add_light(
                pv.Light(position=place, focal_point=(0, 0, 0), light_type="camera light", intensity=strength)
            )
        plotter.add_text(str(scene["titles"][column]), position="upper_edge", font_size=11, color="#333333")
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
