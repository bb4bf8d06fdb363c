"""The paper's own numbers (its tables 1 and 2 and its figure of partial shapes), laid out beside what is measured here.

They were measured on other shapes, against another database, after longer trainings. What can be compared is the order
of the methods, and how many times the error of KP-RED each of them has.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

from kpred.evaluation.methods.method import FEED_FORWARD
from kpred.evaluation.metrics.metric import SEEN, WHOLE
from kpred.evaluation.page import Page
from kpred.evaluation.tables.page_parts import hidden, shown
from kpred.evaluation.tables.table import ALL, Series, Table
from kpred.nn.config import PRESETS

KP_RED = "kp-red"

Row = tuple[float, float, float, float]
"""Chair, table, cabinet, and the mean over all instances; the paper's unit."""

CATEGORIES = ("chair", "table", "cabinet", ALL)

FULL: Mapping[str, Row] = {
    "shapeflow": (0.238, 0.400, 0.514, 0.340),
    "uy2021": (0.182, 0.170, 0.179, 0.166),
    "u-red": (0.238, 0.088, 0.123, 0.143),
    KP_RED: (0.091, 0.084, 0.109, 0.089),
}
SCAN2CAD: Mapping[str, Row] = {
    "shapeflow": (0.230, 0.302, 0.345, 0.265),
    "uy2021": (0.158, 0.190, 0.676, 0.210),
    "u-red": (0.227, 0.132, 0.316, 0.207),
    KP_RED: (0.059, 0.057, 0.073, 0.060),
}
PARTIAL: Mapping[float, Mapping[str, Row]] = {
    0.0: {
        "shapeflow": (0.168, 0.182, 0.283, 0.183),
        "uy2021": (0.091, 0.085, 0.092, 0.083),
        "u-red": (0.121, 0.045, 0.067, 0.074),
        KP_RED: (0.048, 0.043, 0.060, 0.046),
    },
    0.25: {
        "shapeflow": (0.186, 0.217, 0.297, 0.210),
        "uy2021": (0.145, 0.191, 0.293, 0.179),
        "u-red": (0.203, 0.168, 0.137, 0.180),
        KP_RED: (0.050, 0.046, 0.060, 0.049),
    },
    0.5: {
        "shapeflow": (0.271, 0.352, 0.293, 0.314),
        "uy2021": (0.194, 0.272, 0.301, 0.241),
        "u-red": (0.264, 0.227, 0.240, 0.255),
        KP_RED: (0.056, 0.056, 0.061, 0.056),
    },
    0.75: {
        "shapeflow": (0.301, 0.363, 0.337, 0.335),
        "uy2021": (0.232, 0.292, 0.344, 0.270),
        "u-red": (0.315, 0.264, 0.349, 0.306),
        KP_RED: (0.061, 0.069, 0.070, 0.066),
    },
}
"""By the fraction hidden."""


def published_pages(table: Table, dataset: str) -> Iterator[Page]:
    """Lay out the paper's numbers for the methods that are in a table, if there is one of them."""
    methods = {name: method for name in table.header["models"] if (method := _method(table.header["models"][name]))}
    series = [
        one
        for one in table.series(dataset)
        if one.model in methods and one.method == FEED_FORWARD and one.is_error and _is_the_papers(table, one)
    ]
    found = [(one, row) for one in series if (row := _published(table, one, methods[one.model])) is not None]
    if not found:
        return
    ours = next((name for name, method in methods.items() if method == KP_RED), None)
    categories = [name for name in CATEGORIES if name in table.categories(dataset)]
    last = table.categories(dataset)[-1]
    rows = []
    for one, row in found:
        base = _of_model(series, one, ours)
        ratio = None if base is None or base == one else table.ratio(one, base, dataset, last)
        values = (f"{row[CATEGORIES.index(name)]:.3f}" for name in categories)
        reference = _published(table, one, KP_RED)
        place = CATEGORIES.index(last) if last in CATEGORIES else -1
        times = "" if reference is None else f"{row[place] / reference[place]:.2f}"
        rows.append([one.model, hidden(one), *values, times, shown(ratio)])
    yield Page(
        f"{dataset}: the paper's own numbers, x 10^2, on other data; then error over KP-RED's, {last}",
        ["model", "hidden", *categories, "/ KP-RED, paper", "/ KP-RED, here"],
        rows,
    )


def _method(provenance: Mapping[str, Any]) -> str | None:
    """Name the paper's method that a row's networks are, by what they were made by; None for others."""
    training = provenance.get("training")
    if training:
        name = training[0].get("peer")
        return name if name in FULL else None
    settings = [config.items() for config in provenance.get("settings", {}).values()]
    is_kp_red = settings and all(item in config for config in settings for item in PRESETS[KP_RED].items())
    return KP_RED if is_kp_red else None


def _is_the_papers(table: Table, series: Series) -> bool:
    """Decide whether a series is measured from the surface that the paper measures from."""
    # On Scan2CAD it measures from the annotated model.
    return series.metric.surface == (WHOLE if table.header["table"] == "scan2cad" else SEEN)


def _published(table: Table, series: Series, method: str) -> Row | None:
    kind = table.header["table"]
    if kind == "partial":
        return PARTIAL.get(series.occlusion, {}).get(method)
    return {"full": FULL, "scan2cad": SCAN2CAD}.get(kind, {}).get(method)


def _of_model(series: list[Series], like: Series, model: str | None) -> Series | None:
    """Find the series of a model that is measured as another is."""
    return next((one for one in series if one.model == model and one.occlusion == like.occlusion), None)
