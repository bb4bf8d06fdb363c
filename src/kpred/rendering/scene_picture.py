"""A picture of a scene: the scan, and the fitted CAD models where its objects stand, seen by one camera.

As in `kpred.rendering.picture`, pyvista draws in a process of its own, and matplotlib where that fails.
"""

from __future__ import annotations

import subprocess
import sys
import tempfile
import warnings
from dataclasses import dataclass, fields
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import numpy as np

from kpred.atomic import atomic_path
from kpred.errors import OutputError
from kpred.fitting.fit_scene import OBJECT_COLORS, SceneFit
from kpred.rendering.picture import PictureWarning

PICTURE_SIZE = (2000, 900)
"""Width and height in pixels."""

VIEW_DIRECTION = (0.55, 0.95, 0.8)
"""From the scene to the eye, y up: from above, so that walls hide little."""

_DRAWN_POINTS = 120_000
_FAINT_POINTS = 25_000
_SECONDS = 180.0
_PLAIN = (150, 158, 168)
_DPI = 100


@dataclass(frozen=True, eq=False)
class SceneView:
    """What the two panels show, in the frame of the GLB: y up, the scan's units."""

    points: np.ndarray
    """(N, 3) float32 of the scan"""
    colors: np.ndarray
    """(N, 3) uint8"""
    scan_faces: np.ndarray
    """(G, 3) int32 rows of points; none for a cloud"""
    one_sided: np.ndarray
    """() bool: faces look at the side that the scanner stood on, so that those seen from behind can be left out"""
    vertices: np.ndarray
    """(V, 3) float32 of all CAD models"""
    faces: np.ndarray
    """(F, 3) int32"""
    face_colors: np.ndarray
    """(F, 3) uint8"""
    labels: np.ndarray
    """(K,) str, names of the fitted objects"""
    anchors: np.ndarray
    """(K, 3) float32, where the names stand"""
    titles: np.ndarray
    """(2,) str"""

    def camera(self) -> tuple[np.ndarray, float]:
        """Centre (3,) and radius of a ball around nearly all that is shown."""
        everything = np.concatenate([self.points, self.vertices]).astype(np.float64)
        low, high = np.quantile(everything, [0.002, 0.998], axis=0)
        return (low + high) / 2, float(np.linalg.norm(high - low) / 2)


def scene_view(scene_fit: SceneFit) -> SceneView:
    """What the picture of a scene shows; clouds are thinned, meshes are not."""
    scene = scene_fit.scene
    turn = scene_fit.scan_to_glb()[:3, :3]
    points = (scene.points @ turn.T).astype(np.float32)
    finite = np.isfinite(points).all(axis=1)
    colors = scene.colors if scene.colors is not None else np.full(points.shape, _PLAIN, np.uint8)
    faces = np.zeros((0, 3), np.int32) if scene.faces is None else scene.faces.astype(np.int32)
    if len(faces):
        faces = faces[finite[faces].all(axis=1)]
        points = np.where(finite[:, None], points, 0.0)
    else:
        rows = np.flatnonzero(finite)
        rows = rows[:: max(1, -(-len(rows) // _DRAWN_POINTS))]
        points, colors = points[rows], colors[rows]
    vertices, triangles, painted, labels, anchors = [np.zeros((0, 3))], [np.zeros((0, 3), np.int64)], [], [], []
    count = 0
    for number, item in enumerate(scene_fit.fitted):
        assert item.fit is not None
        placed = np.asarray(item.fit.mesh.vertices) @ turn.T
        corners = np.asarray(item.fit.mesh.faces)
        vertices.append(placed)
        triangles.append(corners + count)
        painted.append(np.tile(OBJECT_COLORS[number % len(OBJECT_COLORS)], (len(corners), 1)))
        labels.append(item.object.name)
        low, high = placed.min(axis=0), placed.max(axis=0)
        anchors.append(np.array([(low[0] + high[0]) / 2, high[1], (low[2] + high[2]) / 2]))
        count += len(placed)
    return SceneView(
        points=points.astype(np.float32),
        colors=np.ascontiguousarray(colors, dtype=np.uint8),
        scan_faces=faces,
        one_sided=np.array(_is_one_sided(points, faces)),
        vertices=np.concatenate(vertices).astype(np.float32),
        faces=np.concatenate(triangles).astype(np.int32),
        face_colors=np.concatenate([np.zeros((0, 3)), *painted]).astype(np.uint8),
        labels=np.array(labels, dtype=str),
        anchors=np.array(anchors, dtype=np.float32).reshape(-1, 3),
        titles=np.array([f"scan {scene.name}", f"{len(labels)} CAD models for {len(scene_fit.fits)} objects"]),
    )


def _is_one_sided(points: np.ndarray, faces: np.ndarray) -> bool:
    """Whether nearly all level faces look up, as floors and table tops of a well-oriented scan do."""
    if not len(faces):
        return False
    corners = points[faces].astype(np.float64)
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    level = normals[np.abs(normals[:, 1]) > 0.9 * np.linalg.norm(normals, axis=1), 1]
    return bool(level[level > 0].sum() > 0.8 * np.abs(level).sum() > 0)


def save_scene_picture(scene_fit: SceneFit, path: str | Path) -> bool:
    """Write a PNG of the scan and of the CAD scene side by side, whole or not at all.

    Returns:
        Whether the picture was written. When neither pyvista nor matplotlib is installed, a `PictureWarning` says so.

    Raises:
        OutputError: the extension is not .png, or the file cannot be written there.
    """
    target = Path(path)
    if target.suffix.lower() != ".png":
        raise OutputError(f"Cannot write {target}: pictures are .png files; give it that extension.")
    view = scene_view(scene_fit)
    with tempfile.TemporaryDirectory(prefix="kpred-picture-") as folder:
        picture = Path(folder) / "picture.png"
        trouble = _draw_apart(view, Path(folder), picture)
        if trouble is not None:
            if find_spec("matplotlib") is None:
                warnings.warn(f"No picture: {trouble}.", PictureWarning, stacklevel=2)
                return False
            warnings.warn(f"Plain picture by matplotlib: {trouble}.", PictureWarning, stacklevel=2)
            _draw_plainly(view, picture)
        with atomic_path(target) as temporary:
            temporary.write_bytes(picture.read_bytes())
    return True


def _draw_apart(view: SceneView, folder: Path, picture: Path) -> str | None:
    """Draw with pyvista in another process; None when that worked, else a clause that says why not and the mend."""
    if find_spec("pyvista") is None:
        return "pyvista is not installed (pip install 'kpred[pictures]')"
    file = folder / "scene.npz"
    center, radius = view.camera()
    arrays = {item.name: getattr(view, item.name) for item in fields(view)}
    np.savez(file, **arrays, center=center, radius=radius, direction=VIEW_DIRECTION, size=PICTURE_SIZE)
    script = Path(__file__).with_name("draw_scene_pyvista.py")
    command = [sys.executable, "-P", str(script), str(file), str(picture)]
    try:
        done = subprocess.run(command, capture_output=True, stdin=subprocess.DEVNULL, timeout=_SECONDS)
    except (OSError, subprocess.TimeoutExpired) as error:
        return f"drawing with pyvista failed ({type(error).__name__})"
    if done.returncode == 0 and picture.is_file() and picture.stat().st_size:
        return None
    picture.unlink(missing_ok=True)
    return "pyvista found no graphics library that works (on Debian or Ubuntu: apt-get install libegl1 libgl1-mesa-dri)"


def _draw_plainly(view: SceneView, path: Path) -> None:
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.collections import PolyCollection
    from matplotlib.figure import Figure

    figure = Figure(figsize=(PICTURE_SIZE[0] / _DPI, PICTURE_SIZE[1] / _DPI), dpi=_DPI, facecolor="white")
    FigureCanvasAgg(figure)
    center, radius = view.camera()
    toward = np.asarray(VIEW_DIRECTION) / np.linalg.norm(VIEW_DIRECTION)
    right = np.cross([0.0, 1.0, 0.0], toward)
    right /= np.linalg.norm(right)
    axes3 = np.stack([right, np.cross(toward, right), toward], axis=1)
    flat = (view.points.astype(np.float64) - center) @ axes3
    # Painter's order: far things first.
    order = np.argsort(flat[:, 2])
    for column in range(2):
        axes: Any = figure.add_axes((column / 2, 0.0, 0.5, 0.94))
        axes.set_axis_off()
        axes.set_aspect("equal")
        axes.set_xlim(-radius, radius)
        axes.set_ylim(-0.9 * radius, 0.9 * radius)
        axes.set_title(str(view.titles[column]), color="#333333", fontsize=13)
        if column == 0:
            axes.scatter(flat[order, 0], flat[order, 1], c=view.colors[order] / 255.0, s=2, linewidths=0)
            continue
        few = flat[:: max(1, -(-len(flat) // _FAINT_POINTS))]
        axes.scatter(few[:, 0], few[:, 1], c="#cfd4da", s=0.5, linewidths=0)
        corners = ((view.vertices.astype(np.float64) - center) @ axes3)[view.faces]
        depth = np.argsort(corners[:, :, 2].mean(axis=1))
        normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        facing = np.abs(normals[:, 2]) / np.maximum(np.linalg.norm(normals, axis=1), 1e-12)
        shades = (view.face_colors / 255.0 * (0.55 + 0.45 * facing)[:, None]).clip(0, 1)[depth]
        axes.add_collection(
            PolyCollection(list(corners[depth, :, :2]), facecolors=shades, edgecolors=shades, linewidths=0.3),
            autolim=False,
        )
        for name, place in zip(view.labels, (view.anchors - center) @ axes3, strict=True):
            axes.text(place[0], place[1], str(name), fontsize=8, color="#222222", ha="center", zorder=4)
    figure.savefig(path, dpi=_DPI)
