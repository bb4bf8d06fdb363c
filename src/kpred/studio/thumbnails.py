"""Thumbnails of the candidates, numbered, on one picture."""

from __future__ import annotations

import math

import numpy as np
from PIL import Image, ImageDraw, ImageFont

from kpred.fitting.result import Fit
from kpred.ops.typing import UInt8
from kpred.rendering.thumbnail import draw_thumbnail

SIDE, COLUMNS = 72, 5
"""Width and height of a thumbnail, pixels; thumbnails in a row."""

_TEXT, _CHOSEN = (40, 40, 40), (33, 102, 172)


def candidate_thumbnails(fit: Fit) -> list[UInt8[np.ndarray, "side side 3"]]:
    """Draw each candidate of a fit as it was deformed, seen from the front, side and above."""
    found = []
    for rank in range(len(fit.candidates)):
        mesh = fit.candidate(rank)
        vertices = fit.frame.to_unit(np.asarray(mesh.vertices, dtype=np.float64))
        found.append(draw_thumbnail(vertices, np.asarray(mesh.faces), SIDE))
    return found


def thumbnail_sheet(thumbnails: list[UInt8[np.ndarray, "side side 3"]], chosen: int | None) -> np.ndarray:
    """Put numbered thumbnails on one picture (H, W, 3), the chosen one framed."""
    rows = math.ceil(len(thumbnails) / COLUMNS)
    sheet = Image.new("RGB", (COLUMNS * SIDE, rows * SIDE), "white")
    pen, font = ImageDraw.Draw(sheet), ImageFont.load_default(size=12)
    for number, thumbnail in enumerate(thumbnails):
        left, top = number % COLUMNS * SIDE, number // COLUMNS * SIDE
        sheet.paste(Image.fromarray(thumbnail), (left, top))
        pen.text((left + 4, top + 2), str(number + 1), _CHOSEN if number == chosen else _TEXT, font)
        if number == chosen:
            pen.rectangle((left + 1, top + 1, left + SIDE - 2, top + SIDE - 2), outline=_CHOSEN, width=2)
    return np.asarray(sheet)
