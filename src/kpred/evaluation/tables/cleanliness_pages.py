"""Printed cleanliness: what deformed meshes lost of their models' flatness, right angles, symmetry and contacts."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from kpred.evaluation.page import Page
from kpred.evaluation.tables.page_parts import hidden, label
from kpred.evaluation.tables.scorer import PARTIAL
from kpred.evaluation.tables.table import Cell, Table

COLUMNS = {
    "flatness": ("flat %", 100.0),
    "straightness": ("straight %", 100.0),
    "squareness": ("square °", 1.0),
    "squareness_95": ("square 95 °", 1.0),
    "axis_tilt": ("axis tilt °", 1.0),
    "mirror": ("mirror %", 100.0),
    "part_box": ("box %", 100.0),
    "contact_gap": ("gap %", 100.0),
    "repetition": ("repeats %", 100.0),
    "folded_faces": ("folded", 1.0),
}
"""Measures that are printed: heading, and factor from the measure's own unit; JSON and CSV hold all."""

UNITS = "% of the longest side; square 95: 95th percentile over the right-angled edges of each"


def cleanliness_pages(table: Table, dataset: str, categories: Sequence[str]) -> Iterator[Page]:
    """Lay out the cleanliness of a table's methods on some categories: means, then 95th percentiles."""
    found: dict[tuple[str, ...], dict[str, Cell]] = {}
    series = [one for one in table.series(dataset) if one.metric.name in COLUMNS]
    some_hidden = any(one.protocol == PARTIAL for one in table.series(dataset))
    for category in categories:
        for one in series:
            cell = table.cell(one, dataset, category)
            if cell is not None:
                names = (category, one.model, label(one), *((hidden(one),) if some_hidden else ()))
                found.setdefault(names, {})[one.metric.name] = cell
    if not found:
        return
    heads = ("category", "model", "method", *(("hidden",) if some_hidden else ()))
    columns = [*heads, *(heading for heading, _ in COLUMNS.values())]
    for statistic, attribute in (("mean", "value"), ("95th percentile", "percentile_95")):
        rows = [
            [*names, *(_scaled(cells.get(name), attribute, factor) for name, (_, factor) in COLUMNS.items())]
            for names, cells in found.items()
        ]
        yield Page(f"{dataset}; cleanliness, {statistic} over the targets; {UNITS}", columns, rows)


def _scaled(cell: Cell | None, attribute: str, factor: float) -> float | None:
    """Take one statistic, to four digits after the point."""
    return None if cell is None else round(factor * float(getattr(cell, attribute)), 4)
