"""A 3D view inside a report: points and meshes that the mouse turns (`viewer.js`), as few bytes as are seen."""

from __future__ import annotations

import base64
import json
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from kpred.ops.typing import Float, Int, UInt8
from kpred.reports.page import tag, text_of

MAX_POINTS = 40_000
"""Points of a layer; more are thinned evenly."""

MAX_TRIANGLES = 200_000
"""Triangles of a page, about 4 MB; meshes that come after are left out."""


@dataclass(frozen=True, eq=False)
class Shape:
    """Points or a mesh of a 3D view, y up, front +z.

    Attributes:
        layer: name of the switch that shows it; shapes of one layer are switched together.
        vertices: (N, 3) in the frame of the view; faces: (F, 3), none for points.
        colors: uint8, (1, 3) of all or (N, 3) of points.
        on: whether it is shown at first; size: of points, pixels.
    """

    layer: str
    vertices: Float[np.ndarray, "vertices 3"]
    faces: Int[np.ndarray, "faces 3"]
    colors: UInt8[np.ndarray, "colors 3"]
    on: bool = True
    size: float = 2.5

    @classmethod
    def of_points(
        cls,
        layer: str,
        points: Float[np.ndarray, "points 3"],
        colors: UInt8[np.ndarray, "colors 3"],
        on: bool = True,
        size: float = 2.5,
    ) -> Shape:
        """Make a layer of finite points, thinned evenly."""
        rows = np.flatnonzero(np.isfinite(points).all(axis=1))
        rows = rows[:: max(1, -(-len(rows) // MAX_POINTS))]
        few = colors if len(colors) == 1 else colors[rows]
        return cls(layer, points[rows], np.zeros((0, 3), np.int64), few, on, size)


def color(*rgb: int) -> UInt8[np.ndarray, "1 3"]:
    """Return one colour (red, green, blue; 0 to 255) as an array (1, 3)."""
    return np.array([rgb], np.uint8)


def viewer(shapes: Sequence[Shape], max_triangles: int = MAX_TRIANGLES) -> str:
    """Return the HTML of a 3D view, one a page; nothing where there is nothing to see.

    Shapes are numbered as given: a button with `data-focus="K"` looks at shape K.
    """
    kept, left_out = _within_budget(shapes, max_triangles)
    every = [shape.vertices for shape in kept if len(shape.vertices)]
    if not every:
        return ""
    low, high = np.min([one.min(axis=0) for one in every], axis=0), np.max([one.max(axis=0) for one in every], axis=0)
    longest = float((high - low).max()) or 1.0
    extent = np.maximum(high - low, 1e-6 * longest)
    content = {
        # The longest side is 1.5: the camera begins at a distance of 3.
        "extent": (1.5 * extent / longest).tolist(),
        "items": [_item(shape, low, extent) for shape in kept],
    }
    # A script's text ends at `</script>`, whatever it holds: no `<` is left in it.
    data = json.dumps(content, separators=(",", ":")).replace("<", "\\u003c")
    hint = "Drag to turn, wheel to zoom, shift-drag to move, double-click to begin again."
    if left_out:
        hint += f" {left_out} meshes with too many triangles for a page are not shown."
    canvas = tag("canvas", data_scene="data-scene", aria_label="3D view")
    script = f'<script type="application/json" id="data-scene">{data}</script>'
    return tag(
        "div", canvas + tag("div", class_="layers") + tag("p", text_of(hint), class_="lead") + script, class_="view"
    )


def _within_budget(shapes: Sequence[Shape], max_triangles: int) -> tuple[list[Shape], int]:
    """Empty the meshes beyond the budget of triangles, so that numbers stay, and count them."""
    kept, total, left_out = [], 0, 0
    for shape in shapes:
        total += len(shape.faces)
        if len(shape.faces) and total > max_triangles:
            total -= len(shape.faces)
            left_out += 1
            kept.append(Shape(shape.layer, np.zeros((0, 3)), np.zeros((0, 3), np.int64), shape.colors[:1], shape.on))
        else:
            kept.append(shape)
    return kept, left_out


def _item(shape: Shape, low: np.ndarray, extent: np.ndarray) -> dict[str, Any]:
    steps = np.clip((shape.vertices - low) / extent, 0.0, 1.0) * 65535
    # The whole view is centred: its middle is (0.5, 0.5, 0.5) of each extent.
    item: dict[str, Any] = {
        "layer": shape.layer,
        "on": shape.on,
        "points": not len(shape.faces),
        "size": shape.size,
        "color": shape.colors[0].tolist(),
        "vertices": _base64(steps.round().astype("<u2")),
    }
    if len(shape.faces):
        item["faces"] = _base64(shape.faces.astype("<u4"))
    if len(shape.colors) > 1:
        item["colors"] = _base64(shape.colors.astype(np.uint8))
    return item


def _base64(values: np.ndarray) -> str:
    return base64.b64encode(np.ascontiguousarray(values).tobytes()).decode()
