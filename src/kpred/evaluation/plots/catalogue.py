"""A sheet of thumbnails: the models of a category of a database with their ids, sizes and licences."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np
from PIL import Image, ImageDraw, ImageFont

from kpred.database import Database, Entry
from kpred.evaluation.plots.figure import DPI, new_figure
from kpred.evaluation.plots.views import mesh_picture

if TYPE_CHECKING:
    from matplotlib.figure import Figure

COLUMNS = 8
THUMBNAIL = 220
"""Pixels of each picture."""

LINE = 18
LINES = 3
_TEXT = (40, 40, 40)


def catalogue_figure(database: Database, category: str, max_models: int = 200, seed: int = 0) -> Figure:
    """Draw the models of one category, by id, each from the front, the right and above.

    Args:
        max_models: maximum number of models, drawn by seed.

    Raises:
        DatabaseError: the database has no models of the category.
    """
    ids = list(database.model_ids(category))
    if len(ids) > max_models:
        ids = sorted(np.random.default_rng(seed).choice(ids, max_models, replace=False).tolist())
    sheet = catalogue_sheet([database.entry(name) for name in ids])
    figure = new_figure(sheet.width / DPI, sheet.height / DPI)
    axes: Any = figure.add_axes((0, 0, 1, 1))
    axes.set_axis_off()
    axes.imshow(np.asarray(sheet), interpolation="none")
    return figure


def catalogue_sheet(entries: list[Entry]) -> Image.Image:
    """Draw models row by row, at least one."""
    columns = min(COLUMNS, len(entries))
    height = THUMBNAIL + LINES * LINE
    sheet = Image.new("RGB", (columns * THUMBNAIL, -(-len(entries) // columns) * height), "white")
    pen, font = ImageDraw.Draw(sheet), ImageFont.load_default(size=0.75 * LINE)
    for number, entry in enumerate(entries):
        left, top = number % columns * THUMBNAIL, number // columns * height
        vertices = entry.frame.to_unit(entry.mesh.vertices.astype(np.float64))
        sheet.paste(Image.fromarray(mesh_picture(vertices, entry.mesh.faces, THUMBNAIL)), (left, top))
        for row, text in enumerate(_labels(entry.model_id, entry.metadata, np.ptp(entry.mesh.vertices, axis=0))):
            pen.text((left + 4, top + THUMBNAIL + row * LINE), _cut(text, font), _TEXT, font)
    return sheet


def _labels(model_id: str, metadata: Mapping[str, str], size: np.ndarray) -> tuple[str, str, str]:
    sides = " x ".join(f"{side:.3g}" for side in size)
    owner = ", ".join(filter(None, (metadata.get("author", ""), metadata.get("licence", ""))))
    return model_id.rpartition("/")[2], sides, owner


def _cut(text: str, font: ImageFont.FreeTypeFont | ImageFont.ImageFont) -> str:
    """Shorten a label that is wider than a picture."""
    plain = "".join(letter if letter.isprintable() else " " for letter in text)
    while len(plain) > 1 and font.getlength(plain) > THUMBNAIL - 8:
        plain = plain[:-2] + "…"
    return plain
