"""A picture of a fit: the scan, the retrieved CAD model as it is in the database, and the deformed result."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any, Protocol, runtime_checkable

import numpy as np

from kpred.ops.frames import Frame
from kpred.rendering.draw import check_png, draw_view
from kpred.rendering.view import Color, Layer, Panel, Style, View

PICTURE_SIZE = (1800, 640)
"""Width and height in pixels."""

_RETRIEVED, _RESULT, _POINTS = (185, 196, 208), (111, 159, 216), (209, 73, 91)
_DRAWN_POINTS = 6000
_CLOSENESS = 1 / 1.05


@runtime_checkable
class _Pictured(Protocol):
    """What the picture needs of a `Fit`: meshes in the scan's frame and the frame that takes them to the unit box."""

    @property
    def frame(self) -> Frame: ...
    @property
    def mesh(self) -> Any: ...
    @property
    def retrieved_mesh(self) -> Any: ...


def fit_view(fit: _Pictured, scan: np.ndarray, titles: Sequence[str] | None = None) -> View:
    """Make the view of a fit, in the unit box (y up, front +z).

    Args:
        scan: (N, 3) in its own frame and units; thinned to a few thousand points.
        titles: of the three panels.
    """
    points = np.asarray(scan, dtype=np.float64)
    points = points[:: max(1, -(-len(points) // _DRAWN_POINTS))]
    cloud = fit.frame.to_unit(points).astype(np.float32)
    retrieved, result = _mesh(fit.frame, fit.retrieved_mesh, _RETRIEVED), _mesh(fit.frame, fit.mesh, _RESULT)
    by_height = _cloud(cloud, (), Style(point_size=9.0, balls=True))
    over = _cloud(cloud, _POINTS, Style(point_size=5.0, balls=True, lifted=True))
    every = np.concatenate([cloud, retrieved.vertices, result.vertices]).astype(np.float64)
    low, high = every.min(axis=0), every.max(axis=0)
    layers = ((by_height,), (retrieved,), (result, over))
    return View(
        panels=tuple(Panel(*each) for each in zip(titles or _titles(fit), layers, strict=True)),
        size=PICTURE_SIZE,
        center=(low + high) / 2,
        radius=float(np.linalg.norm(high - low) / 2),
        closeness=_CLOSENESS,
    )


def save_picture(fit: _Pictured, scan: np.ndarray, path: str | Path) -> bool:
    """Write a PNG of scan, retrieved model and result side by side, seen by one camera.

    Args:
        fit: a `Fit`; `.mesh` and `.retrieved_mesh` lie in the scan's frame.
        scan: (N, 3) points in their own frame and units.
        path: the PNG file; it is written whole or not at all.

    Returns:
        Whether the picture was written; see `kpred.rendering.draw.draw_view`.

    Raises:
        OutputError: the extension is not .png, or the file cannot be written there.
    """
    return draw_view(fit_view(fit, scan), check_png(path))


def _cloud(points: np.ndarray, color: Color | tuple[()], style: Style) -> Layer:
    return Layer(points, np.zeros((0, 3), np.int32), np.array(color, np.uint8).reshape(-1, 3), style)


def _mesh(frame: Frame, mesh: Any, color: Color) -> Layer:
    vertices = frame.to_unit(np.asarray(mesh.vertices, dtype=np.float64)).astype(np.float32)
    return Layer(vertices, np.asarray(mesh.faces, np.int32), np.array([color], np.uint8), Style(smooth=True))


def _titles(fit: _Pictured) -> list[str]:
    model_id = getattr(getattr(fit, "source", None), "model_id", "")
    return ["scan", f"retrieved {model_id}".strip(), "deformed to the scan"]
