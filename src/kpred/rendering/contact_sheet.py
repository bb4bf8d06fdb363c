"""A contact sheet: many scans beside what was made of them, on one labelled picture. Needs no graphics library."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

import numpy as np
import trimesh
from PIL import Image, ImageDraw, ImageFont

from kpred.atomic import atomic_path, check_place
from kpred.ops.typing import Float
from kpred.rendering.draw import check_png
from kpred.rendering.overlay import draw_overlay
from kpred.rendering.view import square_camera
from kpred.shapes.camera import Camera

Verdict = Literal["right", "wrong", "open"]

PANEL = 260
"""Width and height, in pixels, of each of a tile's three panels: scan, result, both."""

COLUMNS = 3
LINE = 22
MARGIN = 10

_BORDER = {"right": (70, 150, 90), "wrong": (200, 60, 60), "open": (150, 150, 150)}
_TEXT = (40, 40, 40)
_LOW, _HIGH = np.array([50, 70, 140]), np.array([60, 170, 120])
_SCAN_ON_RESULT = np.array([205, 50, 70])
_FOCAL = 2.2
_DRAWN_ON_RESULT = 900


@dataclass(frozen=True, eq=False)
class Tile:
    """One scan and its result.

    Attributes:
        lines: labels, at most a few words each.
        verdict: colour of the frame.
        scan: (N, 3) y up, front +z where it is known, in any unit.
        result: mesh in the same frame; None where there is none.
    """

    lines: tuple[str, ...]
    verdict: Verdict
    scan: Float[np.ndarray, "points 3"]
    result: trimesh.Trimesh | None = None


def draw_tile(tile: Tile) -> np.ndarray:
    """(PANEL, 3 PANEL, 3) uint8: the scan, the result, and the scan's points on the result."""
    camera = _camera(tile)
    scan = _canvas()
    depth = camera.project(tile.scan)[1]
    height = tile.scan[:, 1] - tile.scan[:, 1].min()
    share = (height / max(float(height.max()), np.finfo(float).tiny))[:, None]
    # Painter's order: far points first.
    order = np.argsort(-depth)
    _dot(scan, camera, tile.scan[order], (_LOW + share * (_HIGH - _LOW))[order])
    if tile.result is None:
        return np.concatenate([scan, _canvas(), _canvas()], axis=1)
    result = draw_overlay(_canvas(), np.asarray(tile.result.vertices), np.asarray(tile.result.faces), camera, 1.0)
    both = result.copy()
    few = tile.scan[:: max(1, len(tile.scan) // _DRAWN_ON_RESULT)]
    _dot(both, camera, few, np.broadcast_to(_SCAN_ON_RESULT, few.shape))
    return np.concatenate([scan, result, both], axis=1)


def draw_contact_sheet(tiles: Sequence[Tile], columns: int = COLUMNS) -> Image.Image:
    """Draw at least one tile, row by row, each with its labels above."""
    columns = min(columns, len(tiles))
    lines = max(len(tile.lines) for tile in tiles)
    width, height = 3 * PANEL + 2 * MARGIN, PANEL + LINE * lines + 2 * MARGIN
    rows = math.ceil(len(tiles) / columns)
    sheet = Image.new("RGB", (columns * width, rows * height), "white")
    pen = ImageDraw.Draw(sheet)
    font = ImageFont.load_default(size=0.75 * LINE)
    for number, tile in enumerate(tiles):
        left, top = number % columns * width, number // columns * height
        for row, line in enumerate(tile.lines):
            pen.text((left + 2 * MARGIN, top + MARGIN + row * LINE), _fitting(line, font, width), _TEXT, font)
        sheet.paste(Image.fromarray(draw_tile(tile)), (left + MARGIN, top + MARGIN + LINE * lines))
        corners = (left + MARGIN // 2, top + MARGIN // 2, left + width - MARGIN // 2, top + height - MARGIN // 2)
        pen.rectangle(corners, outline=_BORDER[tile.verdict], width=3)
    return sheet


def check_picture(path: str | Path) -> None:
    """Refuse a place for a picture before any work is done for it.

    Raises:
        OutputError: the extension is not .png, or the file cannot be written there.
    """
    check_place(check_png(path))


def save_contact_sheet(tiles: Sequence[Tile], path: str | Path) -> None:
    """Write a contact sheet as PNG, whole or not at all.

    Raises:
        OutputError: the extension is not .png, or the file cannot be written there.
    """
    check_picture(path)
    with atomic_path(path) as temporary:
        draw_contact_sheet(tiles).save(temporary, format="PNG")


def _canvas() -> np.ndarray:
    return np.full((PANEL, PANEL, 3), 255, dtype=np.uint8)


def _camera(tile: Tile) -> Camera:
    """Make a camera that sees scan and result from the front, side and above; strays may lie outside."""
    low, high = np.quantile(tile.scan, [0.01, 0.99], axis=0)
    if tile.result is not None:
        vertices = np.asarray(tile.result.vertices, dtype=np.float64)
        low, high = np.minimum(low, vertices.min(axis=0)), np.maximum(high, vertices.max(axis=0))
    radius = float(np.linalg.norm(high - low)) / 2 or 1.0
    return square_camera((low + high) / 2, _FOCAL * radius * 1.2, _FOCAL, PANEL)


def _dot(canvas: np.ndarray, camera: Camera, points: np.ndarray, colors: np.ndarray) -> None:
    """Paint points, two pixels wide, one after the other."""
    pixels, depth = camera.project(points)
    for down, across in ((0, 0), (0, 1), (1, 0), (1, 1)):
        column, row = np.floor(pixels + (across, down)).astype(np.int64).T
        inside = (depth > 0) & (column >= 0) & (column < PANEL) & (row >= 0) & (row < PANEL)
        canvas[row[inside], column[inside]] = colors[inside].astype(np.uint8)


def _fitting(line: str, font: ImageFont.FreeTypeFont | ImageFont.ImageFont, width: int) -> str:
    """Cut a line where it would leave its tile."""
    while line and font.getlength(line) > width - 4 * MARGIN:
        line = line.removesuffix("…")[:-1] + "…" if len(line.removesuffix("…")) > 1 else ""
    return line
