"""A fit as a page of HTML: picture, numbers and warnings; for notebooks and browsers."""

from __future__ import annotations

import base64
import os
import tempfile
import webbrowser
from collections.abc import Callable, Mapping, Sequence
from html import escape
from pathlib import Path
from typing import Any, Protocol, runtime_checkable

from kpred.atomic import atomic_path, check_place
from kpred.errors import OutputError
from kpred.fitting.fit_scene import SceneFit
from kpred.rendering.picture import save_picture
from kpred.rendering.scene_picture import save_scene_picture

CANDIDATES = 5
"""Candidates that are listed."""

_STYLE = (
    "font-family:system-ui,sans-serif;max-width:60em;",
    "border-collapse:collapse;font-size:90%;",
    "text-align:left;padding:0.15em 0.8em 0.15em 0;",
)


@runtime_checkable
class _Shown(Protocol):
    """What the page needs of a `Fit`."""

    @property
    def points(self) -> Any: ...
    @property
    def category(self) -> str: ...
    @property
    def confidence(self) -> float: ...
    @property
    def warnings(self) -> Sequence[str]: ...
    @property
    def source(self) -> Any: ...
    @property
    def candidates(self) -> Sequence[Any]: ...
    @property
    def details(self) -> Mapping[str, str]: ...
    @property
    def metrics(self) -> Sequence[Any]: ...


def fit_html(fit: _Shown) -> str:
    """Return a fragment of HTML that needs nothing else; without a picture where none can be drawn."""
    rows = [("model", fit.source.model_id), ("category", fit.category), ("confidence", f"{fit.confidence:.2f}")]
    rows.append(("change", str(fit.source.step)))
    rows += [(key, fit.details[key]) for key in ("title", "author", "licence") if fit.details.get(key)]
    rows += [(one.name.replace("_", " "), f"{one.value:.4g} {one.unit}") for one in fit.metrics]
    others = [
        (str(rank), one.model_id, f"{one.score:.2f}", one.step) for rank, one in enumerate(fit.candidates[:CANDIDATES])
    ]
    warnings = "".join(f"<li>{escape(sentence)}</li>" for sentence in fit.warnings)
    pictured: Any = fit
    drawn = _drawn(lambda file: save_picture(pictured, fit.points, file), "scan, retrieved model, result")
    return (
        f'<div style="{_STYLE[0]}">{drawn}{_table(rows)}'
        + (f"<ul>{warnings}</ul>" if warnings else "")
        + f"<p>Candidates, best first</p>{_table([('', 'model', 'score', 'change'), *others])}</div>"
    )


def room_html(room: SceneFit) -> str:
    """Return a fragment of HTML with the picture of a room and its objects; it needs nothing else."""
    rows: list[tuple[str, str, str, str]] = [("object", "model", "category", "confidence")]
    for item in room.fits:
        if item.fit is None:
            rows.append((item.object.name, "", "", item.error or ""))
        else:
            fit = item.fit
            rows.append((item.object.name, fit.source.model_id, fit.category, f"{fit.confidence:.2f}"))
    drawn = _drawn(lambda file: save_scene_picture(room, file), "the scan, and its CAD models")
    return f'<div style="{_STYLE[0]}">{drawn}{_table(rows)}</div>'


def show_fit(fit: _Shown, path: str | os.PathLike[str] | None = None) -> Path:
    """Write a page, open it in the browser if there is one, and return its file.

    Raises:
        OutputError: the extension is not .html, or the file cannot be written there.
    """
    title = escape(f"{fit.category}: {fit.source.model_id}")
    begin = f'<!doctype html><html lang="en"><meta charset="utf-8"><title>{title}</title>'
    return show_page(path, lambda: f"{begin}{fit_html(fit)}</html>\n")


def show_page(path: str | os.PathLike[str] | None, page: Callable[[], str]) -> Path:
    """Write a page to a file, by default a temporary one, open it in the browser if there is one, and return the file.

    Raises:
        OutputError: the extension is not .html, or the file cannot be written there.
    """
    if path is None:
        handle, name = tempfile.mkstemp(prefix="kpred-", suffix=".html")
        os.close(handle)
        file = Path(name)
    else:
        file = Path(path)
        if file.suffix.lower() != ".html":
            raise OutputError(f"Cannot write {file}: pages are .html files; give it that extension.")
        check_place(file)
    text = page()
    with atomic_path(file) as temporary:
        temporary.write_text(text, encoding="utf-8")
    webbrowser.open(file.absolute().as_uri())
    return file


def _drawn(save: Callable[[Path], bool], description: str) -> str:
    """Return a picture as HTML; nothing where none can be drawn."""
    with tempfile.TemporaryDirectory(prefix="kpred-") as folder:
        file = Path(folder) / "picture.png"
        if not save(file):
            return ""
        data = base64.b64encode(file.read_bytes()).decode()
    return f'<img alt="{description}" style="width:100%" src="data:image/png;base64,{data}">'


def _table(rows: Sequence[Sequence[str]]) -> str:
    cells = ("".join(f'<td style="{_STYLE[2]}">{escape(str(cell))}</td>' for cell in row) for row in rows)
    return f'<table style="{_STYLE[1]}">' + "".join(f"<tr>{row}</tr>" for row in cells) + "</table>"
