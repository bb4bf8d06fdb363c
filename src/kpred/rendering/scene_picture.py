"""A picture of a scene: the scan, and the fitted CAD models where its objects stand, seen by one camera."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np

from kpred.fitting.fit_scene import SceneFit
from kpred.fitting.scene_nodes import OBJECT_COLORS
from kpred.ops.typing import Float, Int
from kpred.rendering.draw import check_png, draw_view
from kpred.rendering.view import Layer, Panel, Style, View

PICTURE_SIZE = (2000, 900)
"""Width and height in pixels."""

_DIRECTION = (0.55, 0.95, 0.8)
"""From the scene to the eye, y up: from above, so that walls hide little."""

_DRAWN_POINTS = 120_000
_PLAIN, _FAINT = (150, 158, 168), (213, 217, 222)


def scene_view(scene_fit: SceneFit) -> View:
    """Make the view of a scene, in the frame of the GLB: y up, the scan's units; clouds are thinned, meshes are not."""
    scan = _scan(scene_fit)
    models, anchors = _models(scene_fit)
    is_mesh = bool(len(scan.faces))
    # Near walls are seen from behind: left out, they hide nothing. Colours of a scan hold its light already.
    colored = Style(point_size=4.0, lit=False, one_sided=_is_one_sided(scan.vertices, scan.faces))
    faint = replace(colored, point_size=2.0, opacity=0.3 if is_mesh else 0.5)
    behind = replace(scan, colors=np.array([_FAINT], np.uint8), style=faint)
    labels = tuple(item.object.name for item in scene_fit.fitted)
    every = np.concatenate([scan.vertices, models.vertices]).astype(np.float64)
    low, high = np.quantile(every, [0.002, 0.998], axis=0)
    return View(
        panels=(
            Panel(f"scan {scene_fit.scene.name}", (replace(scan, style=colored),)),
            Panel(f"{len(labels)} CAD models for {len(scene_fit.fits)} objects", (behind, models), labels, anchors),
        ),
        size=PICTURE_SIZE,
        center=(low + high) / 2,
        radius=float(np.linalg.norm(high - low) / 2),
        direction=_DIRECTION,
        angle=28.0,
        closeness=1 / 0.88,
        lights=(0.4, 0.15, 0.15),
        font_size=12,
    )


def save_scene_picture(scene_fit: SceneFit, path: str | Path) -> bool:
    """Write a PNG of the scan and of the CAD scene side by side, whole or not at all.

    Returns:
        Whether the picture was written; see `kpred.rendering.draw.draw_view`.

    Raises:
        OutputError: the extension is not .png, or the file cannot be written there.
    """
    target = check_png(path)
    return draw_view(scene_view(scene_fit), target)


def _scan(scene_fit: SceneFit) -> Layer:
    """Make a layer of the scan's points or mesh, with its colours; points that are not finite are left out."""
    scene = scene_fit.scene
    points = (scene.points @ scene_fit.scan_to_glb()[:3, :3].T).astype(np.float32)
    finite = np.isfinite(points).all(axis=1)
    colors = scene.colors if scene.colors is not None else np.full(points.shape, _PLAIN, np.uint8)
    faces = np.zeros((0, 3), np.int32) if scene.faces is None else scene.faces.astype(np.int32)
    if len(faces):
        faces = faces[finite[faces].all(axis=1)]
        points = np.where(finite[:, None], points, 0.0).astype(np.float32)
    else:
        rows = np.flatnonzero(finite)
        rows = rows[:: max(1, -(-len(rows) // _DRAWN_POINTS))]
        points, colors = points[rows], colors[rows]
    return Layer(points, faces, np.ascontiguousarray(colors, dtype=np.uint8))


def _models(scene_fit: SceneFit) -> tuple[Layer, Float[np.ndarray, "objects 3"]]:
    """Make one layer of all fitted models, and find where their names stand, above each."""
    turn = scene_fit.scan_to_glb()[:3, :3]
    vertices, triangles, painted = [np.zeros((0, 3))], [np.zeros((0, 3), np.int64)], [np.zeros((0, 3))]
    anchors = []
    for number, item in enumerate(scene_fit.fitted):
        assert item.fit is not None
        placed, corners = np.asarray(item.fit.mesh.vertices) @ turn.T, np.asarray(item.fit.mesh.faces)
        triangles.append(corners + sum(map(len, vertices)))
        vertices.append(placed)
        painted.append(np.tile(OBJECT_COLORS[number % len(OBJECT_COLORS)], (len(corners), 1)))
        low, high = placed.min(axis=0), placed.max(axis=0)
        anchors.append(np.array([(low[0] + high[0]) / 2, high[1], (low[2] + high[2]) / 2]))
    layer = Layer(
        np.concatenate(vertices).astype(np.float32),
        np.concatenate(triangles).astype(np.int32),
        np.concatenate(painted).astype(np.uint8),
        Style(ambient=0.25, diffuse=0.8),
    )
    return layer, np.array(anchors, dtype=np.float32).reshape(-1, 3)


def _is_one_sided(points: Float[np.ndarray, "points 3"], faces: Int[np.ndarray, "faces 3"]) -> bool:
    """Decide whether nearly all level faces look up, as floors and table tops of a well-oriented scan do."""
    if not len(faces):
        return False
    corners = points[faces].astype(np.float64)
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    level = normals[np.abs(normals[:, 1]) > 0.9 * np.linalg.norm(normals, axis=1), 1]
    return bool(level[level > 0].sum() > 0.8 * np.abs(level).sum() > 0)
