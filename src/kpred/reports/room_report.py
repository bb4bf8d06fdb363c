"""The report of a room: every object beside its scan, those without a result first, and what stayed unexplained."""

from __future__ import annotations

import os
import tempfile
from pathlib import Path

import numpy as np

from kpred.fitting.fit_scene import SceneFit
from kpred.fitting.object_fit import ObjectFit
from kpred.fitting.scene_nodes import OBJECT_COLORS
from kpred.ops.rotations import upright_rotation
from kpred.rendering.contact_sheet import Tile, draw_tile
from kpred.rendering.page import show_page
from kpred.rendering.scene_picture import save_scene_picture
from kpred.reports.fit_report import fit_tile
from kpred.reports.page import page, section, tag, text_of, warning_list
from kpred.reports.picture import picture, picture_of_file
from kpred.reports.table import Html, Value, facts, meter, sortable
from kpred.reports.viewer import Shape, color, viewer

MAX_PICTURES = 150
"""Objects that are drawn; a room rarely has more."""

COLUMNS = ("object", "category", "points", "model", "mean distance", "seen", "confidence", "warnings", "")


def room_report(room: SceneFit, drawn: Path | None = None) -> str:
    """Return the page of a room; `drawn`: file of its picture (`kpred.rendering.scene_picture`), if there is one."""
    items = sorted(room.fits, key=_order)
    # Shapes of the view: scan, unexplained points, then fitted objects; buttons name them by number.
    numbers = {id(item): number + 2 for number, item in enumerate(room.fitted)}
    failed = sum(item.fit is None and not item.skipped for item in items)
    skipped = sum(item.skipped for item in items)
    lead = f"{len(room.fitted)} of {len(items)} objects have a CAD model; {failed} failed, {skipped} were skipped."
    rows = [_row(item, numbers.get(id(item))) for item in items]
    classes = ["" if item.fit is not None else "failed" for item in items]
    cards = [_card(item) for item in items[:MAX_PICTURES]]
    parts = [
        tag("p", text_of(lead), class_="lead"),
        "" if drawn is None else picture_of_file(drawn, "the scan, and its CAD models"),
        section("In 3D", viewer(_shapes(room))),
        section("Objects", sortable(COLUMNS, rows, classes)),
        section("What stayed unexplained", _unexplained(room)),
        section("Each object: scan, result, both", *cards),
    ]
    return page(f"Room {room.scene.name}", parts, ("viewer.js", "sort.js"))


def show_room(room: SceneFit, path: str | os.PathLike[str] | None = None) -> Path:
    """Write the page of a room, open it in the browser if there is one, and return its file.

    Raises:
        OutputError: the extension is not .html, or the file cannot be written there.
    """

    def made() -> str:
        with tempfile.TemporaryDirectory(prefix="kpred-") as folder:
            drawn = Path(folder) / "room.png"
            return room_report(room, drawn if save_scene_picture(room, drawn) else None)

    return show_page(path, made)


def _order(item: ObjectFit) -> tuple[bool, bool, float]:
    return item.fit is not None, item.skipped, -1.0 if item.fit is None else item.fit.confidence


def _row(item: ObjectFit, number: int | None) -> list[str | int | float | Html | None]:
    name, category, points = item.object.name, item.object.category, len(item.object.points)
    if item.fit is None:
        return [name, category, points, "skipped" if item.skipped else "failed", None, None, None, None, None]
    look = tag("button", "look", data_focus=number, type="button")
    fit = item.fit
    return [
        *(name, fit.category, points, fit.source.model_id, _distance(item), f"{100 * fit.seen:.0f} %"),
        *(meter(fit.confidence), len(fit.warnings), Html(look)),
    ]


def _distance(item: ObjectFit) -> float | None:
    metrics = () if item.fit is None else item.fit.metrics
    return next((one.value for one in metrics if one.name == "mean_scan_to_result"), None)


def _card(item: ObjectFit) -> str:
    title = tag("h3", text_of(item.object.name))
    points = item.object.points[np.isfinite(item.object.points).all(axis=1)]
    if item.fit is None:
        problem = tag("p", text_of(item.error or "It has no result."), class_="problem")
        return tag(
            "div", tag("div", _scan_alone(points, item.object.up)) + tag("div", title + problem), class_="object"
        )
    fit = item.fit
    rows: list[tuple[str, Value | Html]] = [
        ("category", fit.category),
        ("model", fit.source.model_id),
        ("change", str(fit.source.step)),
        ("confidence", meter(fit.confidence)),
        *((one.name.replace("_", " "), f"{one.value:.4g} {one.unit}") for one in fit.metrics),
        ("surface seen", f"{100 * fit.seen:.0f} %"),
        ("licence", fit.details.get("licence")),
    ]
    drawing = picture(fit_tile(fit, points), f"{item.object.name}: scan, result, both")
    return tag(
        "div", tag("div", drawing) + tag("div", title + facts(rows) + warning_list(fit.warnings)), class_="object"
    )


def _scan_alone(points: np.ndarray, up: str) -> str:
    if not len(points):
        return ""
    return picture(draw_tile(Tile((), "open", points @ upright_rotation(up).T)), "scan")


def _unexplained(room: SceneFit) -> str:
    total = int(np.isfinite(room.scene.points).all(axis=1).sum())
    left = len(room.unexplained)
    sentences = []
    if left:
        fraction = 100 * left / max(total, 1)
        sentences.append(f"{left} of {total} points ({fraction:.1f} %) belong to no object, floor, wall or ceiling.")
    sentences += [item.error for item in room.fits if item.fit is None and item.error]
    if not sentences:
        return tag("p", "Nothing: every object that was named has a result.")
    return tag("ul", "".join(tag("li", text_of(sentence)) for sentence in sentences))


def _shapes(room: SceneFit) -> list[Shape]:
    turn = room.scan_to_glb()[:3, :3]
    points = room.scene.points @ turn.T
    colors = color(150, 158, 168) if room.scene.colors is None else room.scene.colors
    finite = points[np.isfinite(points).all(axis=1)]
    low, high = np.quantile(finite, [0.001, 0.999], axis=0)
    room_points = np.where(((points >= low - 0.1) & (points <= high + 0.1)).all(axis=1)[:, None], points, np.nan)
    left = room_points[room.unexplained]
    shapes = [
        Shape.of_points("scan", room_points, colors, size=1.5),
        Shape.of_points("unexplained points", left, color(190, 60, 160), on=False, size=2.5),
    ]
    for number, item in enumerate(room.fitted):
        assert item.fit is not None
        vertices = np.asarray(item.fit.mesh.vertices, dtype=np.float64) @ turn.T
        paint = color(*OBJECT_COLORS[number % len(OBJECT_COLORS)])
        shapes.append(Shape("CAD models", vertices, np.asarray(item.fit.mesh.faces), paint))
    return shapes
