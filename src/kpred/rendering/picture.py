"""A picture of a fit: the scan, the retrieved CAD model as it is in the database, and the deformed result.

VTK loads the machine's graphics libraries and ends the process when there are none, so the drawing with pyvista runs
in a process of its own; where that fails, matplotlib draws the same scene more plainly.
"""

from __future__ import annotations

import subprocess
import sys
import tempfile
import warnings
from collections.abc import Sequence
from dataclasses import dataclass, fields
from importlib.util import find_spec
from pathlib import Path
from typing import Any, Protocol, runtime_checkable

import numpy as np

from kpred.atomic import atomic_path
from kpred.errors import OutputError
from kpred.ops.frames import Frame

PICTURE_SIZE = (1800, 640)
"""Width and height in pixels."""

VIEW_DIRECTION = (0.62, 0.48, 1.0)
"""From the object to the eye, in canonical axes (y up, front +z): three-quarter from the front, from above."""

_DRAWN_POINTS = 6000
_SECONDS = 120.0


class PictureWarning(UserWarning):
    """A picture was left out or drawn more plainly; the message says why and what to do."""


@runtime_checkable
class _TriangleMesh(Protocol):
    @property
    def vertices(self) -> Any: ...
    @property
    def faces(self) -> Any: ...


@runtime_checkable
class _Pictured(Protocol):
    """What the picture needs of a `Fit`: meshes in the scan's frame and the frame that takes them to the unit box."""

    @property
    def frame(self) -> Frame: ...
    @property
    def mesh(self) -> Any: ...
    @property
    def retrieved_mesh(self) -> Any: ...


@dataclass(frozen=True, eq=False)
class Scene:
    """What the three panels show, all in the unit box (y up, front +z)."""

    scan: np.ndarray
    """(N, 3) float32 points"""
    retrieved_vertices: np.ndarray
    """(V, 3) float32"""
    retrieved_faces: np.ndarray
    """(F, 3) int32"""
    result_vertices: np.ndarray
    """(W, 3) float32"""
    result_faces: np.ndarray
    """(G, 3) int32"""
    titles: np.ndarray
    """(3,) str"""

    def camera(self) -> tuple[np.ndarray, float]:
        """Centre (3,) and radius of a ball around everything shown, for one camera in all panels."""
        everything = np.concatenate([self.scan, self.retrieved_vertices, self.result_vertices]).astype(np.float64)
        low, high = everything.min(axis=0), everything.max(axis=0)
        return (low + high) / 2, float(np.linalg.norm(high - low) / 2)


def fit_scene(fit: _Pictured, scan: np.ndarray, titles: Sequence[str] | None = None) -> Scene:
    """The scene of a fit; `scan` (N, 3) in its own frame and units, thinned to a few thousand points."""
    points = np.asarray(scan, dtype=np.float64)
    points = points[:: max(1, -(-len(points) // _DRAWN_POINTS))]
    retrieved, result = _arrays(fit.frame, fit.retrieved_mesh), _arrays(fit.frame, fit.mesh)
    return Scene(
        scan=fit.frame.to_unit(points).astype(np.float32),
        retrieved_vertices=retrieved[0],
        retrieved_faces=retrieved[1],
        result_vertices=result[0],
        result_faces=result[1],
        titles=np.array(titles if titles is not None else _titles(fit), dtype=str),
    )


def save_picture(fit: _Pictured, scan: np.ndarray, path: str | Path) -> bool:
    """Write a PNG of scan, retrieved model and result side by side, seen by one camera.

    Args:
        fit: a `Fit`; `.mesh` and `.retrieved_mesh` lie in the scan's frame.
        scan: (N, 3) points in their own frame and units.
        path: the PNG file; it is written whole or not at all.

    Returns:
        Whether the picture was written. When neither pyvista nor matplotlib is installed or works, a `PictureWarning`
        says so and nothing is written.

    Raises:
        OutputError: the extension is not .png, or the file cannot be written there.
    """
    target = Path(path)
    if target.suffix.lower() != ".png":
        raise OutputError(f"Cannot write {target}: pictures are .png files; give it that extension.")
    scene = fit_scene(fit, scan)
    drawn = False
    with tempfile.TemporaryDirectory(prefix="kpred-picture-") as folder:
        picture = Path(folder) / "picture.png"
        trouble = _draw_apart(scene, Path(folder), picture)
        if trouble is not None:
            if find_spec("matplotlib") is None:
                warnings.warn(f"No picture: {trouble}.", PictureWarning, stacklevel=2)
                return False
            from kpred.rendering.draw_matplotlib import draw_scene

            warnings.warn(f"Plain picture by matplotlib: {trouble}.", PictureWarning, stacklevel=2)
            draw_scene(scene, picture)
        drawn = picture.stat().st_size > 0
        with atomic_path(target) as temporary:
            temporary.write_bytes(picture.read_bytes())
    return drawn


def _draw_apart(scene: Scene, folder: Path, picture: Path) -> str | None:
    """Draw with pyvista in another process; None when that worked, else a clause that says why not and the mend."""
    if find_spec("pyvista") is None:
        return "pyvista is not installed (pip install 'kpred[pictures]')"
    file = folder / "scene.npz"
    center, radius = scene.camera()
    arrays = {item.name: getattr(scene, item.name) for item in fields(scene)}
    np.savez(file, **arrays, center=center, radius=radius, direction=VIEW_DIRECTION, size=PICTURE_SIZE)
    # By path and not as a module: the other process then loads nothing of kpred, and no torch.
    script = Path(__file__).with_name("draw_pyvista.py")
    command = [sys.executable, "-P", str(script), str(file), str(picture)]
    try:
        done = subprocess.run(command, capture_output=True, stdin=subprocess.DEVNULL, timeout=_SECONDS)
    except (OSError, subprocess.TimeoutExpired) as error:
        return f"drawing with pyvista failed ({type(error).__name__})"
    if done.returncode == 0 and picture.is_file() and picture.stat().st_size:
        return None
    picture.unlink(missing_ok=True)
    return "pyvista found no graphics library that works (on Debian or Ubuntu: apt-get install libegl1 libgl1-mesa-dri)"


def _arrays(frame: Frame, mesh: _TriangleMesh) -> tuple[np.ndarray, np.ndarray]:
    vertices = frame.to_unit(np.asarray(mesh.vertices, dtype=np.float64)).astype(np.float32)
    return vertices, np.asarray(mesh.faces, dtype=np.int32)


def _titles(fit: _Pictured) -> list[str]:
    model_id = getattr(getattr(fit, "source", None), "model_id", "")
    return ["scan", f"retrieved {model_id}".strip(), "deformed to the scan"]
