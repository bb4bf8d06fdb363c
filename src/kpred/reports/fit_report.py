"""The report of one fit: picture, 3D view, numbers, candidates, and all that makes it again."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from kpred.errors import DatabaseError
from kpred.fitting.result import Fit
from kpred.rendering.contact_sheet import Tile, draw_tile
from kpred.rendering.deviations import Deviations
from kpred.rendering.thumbnail import draw_thumbnail
from kpred.reports.page import page, section, tag, text_of, warning_list
from kpred.reports.picture import picture, picture_of_file
from kpred.reports.table import facts, meter, shown
from kpred.reports.viewer import Shape, color, viewer

SIDE = 150
"""Pixels of a candidate's thumbnail."""

RESULT, RETRIEVED = color(111, 159, 216), color(185, 196, 208)


def fit_report(fit: Fit, scan: np.ndarray, name: str, drawn: Path | None = None) -> str:
    """Return the page of a fit.

    Args:
        scan: (N, 3) in its own frame and unit; name: of it, for people.
        drawn: file of the fit's picture (`kpred.rendering.picture`); None draws a plainer one.
    """
    record = fit.record()
    deviations = _deviations(fit)
    title = f"{name}: {fit.category} {fit.source.model_id}"
    parts = [
        tag("p", f"Confidence {meter(fit.confidence).content} that the result is right"),
        warning_list(fit.warnings),
        _picture(fit, scan) if drawn is None else picture_of_file(drawn, "scan, retrieved model, result"),
        section("In 3D", viewer(_shapes(fit, scan, deviations)), tag("p", text_of(_distances(fit, deviations)))),
        tag("div", _result(record) + _accuracy(record), class_="columns"),
        section("Candidates, best first", _candidates(fit)),
        tag("div", _reading(record) + _provenance(record), class_="columns"),
    ]
    return page(title, parts, ("viewer.js",))


def fit_tile(fit: Fit, scan: np.ndarray) -> np.ndarray:
    """Draw scan, result and both (H, 3 H, 3), without a graphics library; `scan`: (N, 3) in its own frame."""
    mesh = fit.mesh.copy()
    mesh.vertices = fit.frame.to_unit(np.asarray(mesh.vertices, dtype=np.float64))
    return draw_tile(Tile((), "open", fit.frame.to_unit(np.asarray(scan, dtype=np.float64)), mesh))


def _picture(fit: Fit, scan: np.ndarray) -> str:
    return picture(fit_tile(fit, scan), "scan, result, both", "whole")


def _deviations(fit: Fit) -> Deviations:
    vertices = fit.frame.to_unit(np.asarray(fit.mesh.vertices, dtype=np.float64))
    return Deviations.measure(fit.frame.to_unit(fit.points), vertices, np.asarray(fit.mesh.faces))


def _distances(fit: Fit, deviations: Deviations) -> str:
    return deviations.sentence(fit.frame.scale * fit.unit.metres * 100.0)


def _shapes(fit: Fit, scan: np.ndarray, deviations: Deviations) -> list[Shape]:
    def unit(mesh: Any) -> tuple[np.ndarray, np.ndarray]:
        return fit.frame.to_unit(np.asarray(mesh.vertices, dtype=np.float64)), np.asarray(mesh.faces)

    whole = fit.frame.to_unit(np.asarray(scan, dtype=np.float64))
    # Far strays would make the object a speck.
    whole = whole[(np.abs(whole) < 1.6).all(axis=1)]
    return [
        Shape("result", *unit(fit.mesh), RESULT),
        Shape.of_points("scan by distance", deviations.points, deviations.colors(), size=4.0),
        Shape.of_points("whole scan", whole, color(120, 126, 138), on=False),
        Shape("retrieved model", *unit(fit.retrieved_mesh), RETRIEVED, on=False),
    ]


def _result(record: Mapping[str, Any]) -> str:
    cleanliness, placement, unit = record["cleanliness"], record["model_to_scan"], record["unit"]
    factor = max(placement["scale"])
    rows = [
        ("model", record["model_id"]),
        ("category", record["category"]),
        *((key, record["catalogue"].get(key)) for key in ("title", "author", "licence", "source")),
        ("change", f"{record['step']} (of --deform {record['deform']})"),
        ("own size of the model", "kept" if placement["own_size"] else f"x {factor:.3g}"),
        ("right angles changed by", f"{cleanliness['squareness']:.2g} degrees, mean"),
        ("flat faces bent by", f"{100 * cleanliness['flatness']:.2g} % of the longest side"),
        ("unit of the scan", f"{unit['name']} ({unit['origin']})"),
        ("up in the scan", ", ".join(f"{value:.3g}" for value in record["up"])),
    ]
    return section("Result", facts(rows))


def _accuracy(record: Mapping[str, Any]) -> str:
    rows: list[tuple[str, Any]] = [
        (one["name"].replace("_", " "), f"{shown(one['value'])} {one['unit']}") for one in record["metrics"]
    ]
    rows.append(("surface seen", f"{100 * record['seen']:.0f} %"))
    rows += [(f"is a {name}", meter(value)) for name, value in record["category_confidence"].items()]
    return section("How well it fits", facts(rows))


def _candidates(fit: Fit) -> str:
    figures = []
    for rank, one in enumerate(fit.candidates):
        label = f"{rank + 1}. {one.model_id}"
        caption = f"{text_of(label)}<br>{text_of(one.step)}, error {one.error:.2g}{'' if one.final else ' (estimate)'}"
        try:
            vertices = fit.frame.to_unit(np.asarray(one.mesh.vertices, dtype=np.float64))
            drawing = picture(draw_thumbnail(vertices, np.asarray(one.mesh.faces), SIDE), label)
        except DatabaseError:
            drawing = ""  # The model has left the database since.
        figures.append(tag("figure", drawing + tag("figcaption", caption), class_="" if rank else "chosen"))
    return tag("div", "".join(figures), class_="sheet small")


def _reading(record: Mapping[str, Any]) -> str:
    steps = [(step["name"], f"{step['removed']} points: {step['detail']}") for step in record["cleaning"]]
    seconds = record["timings_seconds"]
    rows = [("points", record["input"]["points"]), *steps, ("time", f"{sum(seconds.values()):.2f} s")]
    return section("How the scan was read", facts(rows))


def _provenance(record: Mapping[str, Any]) -> str:
    versions = ", ".join(f"{name} {value}" for name, value in record["versions"].items())
    rows = [
        ("scan, SHA-256", record["input"]["sha256"]),
        ("database", f"{record['database']['path']} ({record['database']['fingerprint']})"),
        ("weights", f"{record['weights']['model']} ({record['weights']['fingerprint']})"),
        ("mesh, SHA-256", record["mesh_sha256"]),
        ("versions", versions),
    ]
    return section("Made from", facts(rows))
