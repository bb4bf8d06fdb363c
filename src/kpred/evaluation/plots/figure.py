"""Figures as files: PNG or PDF, whole or not at all, drawn without a display."""

from __future__ import annotations

import os
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from kpred.atomic import atomic_path, check_place
from kpred.errors import ConfigError, OutputError

if TYPE_CHECKING:
    from matplotlib.figure import Figure

DPI = 150

COLORS = ("#3566a8", "#d1495b", "#3a9276", "#e0a030", "#7a5aa6", "#5b6470", "#2aa3c4", "#a5673f")
"""Of curves and categories; the first few differ for any colour vision."""


def check_figure(path: str | os.PathLike[str]) -> None:
    """Refuse a figure that cannot be drawn or written, before any work is done for it.

    Raises:
        OutputError: the extension is not .png or .pdf, or the file cannot be written there.
        ConfigError: matplotlib is not installed.
    """
    if Path(path).suffix.lower() not in (".png", ".pdf"):
        raise OutputError(f"Cannot write {path}: figures are .png or .pdf files; give it one of these extensions.")
    check_place(path)
    if find_spec("matplotlib") is None:
        raise ConfigError("Figures need matplotlib, which is not installed; run `pip install 'kpred[pictures]'`.")


def new_figure(width: float, height: float) -> Figure:
    """Make an empty white figure, inches."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    figure = Figure(figsize=(width, height), facecolor="white", layout="constrained")
    FigureCanvasAgg(figure)
    return figure


def save_figure(figure: Figure, path: str | os.PathLike[str]) -> None:
    """Write a figure.

    Raises:
        OutputError: it cannot be written there.
    """
    with atomic_path(path) as temporary:
        # Without dates the same figure is the same file.
        when: dict[str, Any] = {"CreationDate": None} if Path(path).suffix.lower() == ".pdf" else {"Software": None}
        figure.savefig(temporary, dpi=DPI, metadata=when)


def show_pictures(figure: Figure, rows: list[list[np.ndarray | None]], titles: list[str], names: list[str]) -> None:
    """Fill a figure with a grid of pictures (height, width, 3): a title above each column, a name beside each row.

    None leaves a place empty.
    """
    grid: Any = figure.subplots(len(rows), len(titles), squeeze=False)
    for r, row in enumerate(rows):
        for c, picture in enumerate(row):
            axes = grid[r, c]
            axes.set_xticks([])
            axes.set_yticks([])
            for side in axes.spines.values():
                side.set_visible(False)
            if picture is not None:
                axes.imshow(picture)
            if r == 0:
                axes.set_title(titles[c], fontsize=9)
            if c == 0 and names[r]:
                axes.set_ylabel(names[r], fontsize=8)
