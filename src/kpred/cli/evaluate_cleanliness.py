"""Tables of cleanliness: what deformed meshes lost of their models' flatness, right angles, symmetry and contacts."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

from kpred.cli.output import Output
from kpred.cli.table_options import label

if TYPE_CHECKING:
    from kpred.evaluation.tables.table import Table

COLUMNS = {
    "flatness": ("flat %", 100.0),
    "straightness": ("straight %", 100.0),
    "squareness": ("square °", 1.0),
    "squareness_95": ("square 95 °", 1.0),
    "axis_tilt": ("axis tilt °", 1.0),
    "mirror": ("mirror %", 100.0),
    "part_box": ("box %", 100.0),
    "contact_gap": ("gap %", 100.0),
    "folded_faces": ("folded", 1.0),
}
"""Measures that are printed: heading, and factor from the measure's own unit; JSON and CSV hold all."""

UNITS = "% of the longest side; square 95: 95th percentile over the right-angled edges of each"

Values = Mapping[str, tuple[float, float]]
"""Mean and 95th percentile of each measure over the targets."""


def print_cleanliness(
    output: Output, title: str, heads: Sequence[str], rows: Sequence[tuple[Sequence[str], Values]]
) -> None:
    """Print means, then 95th percentiles, a row for each method; `heads` name what stands before the measures."""
    for which, statistic in enumerate(("mean", "95th percentile")) if rows else ():
        body = [
            [*names, *(_cell(values.get(name), which, factor) for name, (_, factor) in COLUMNS.items())]
            for names, values in rows
        ]
        headings = [heading for heading, _ in COLUMNS.values()]
        output.table(f"{title}; cleanliness, {statistic} over the targets; {UNITS}", [*heads, *headings], body)


def print_cleanliness_of(output: Output, table: Table, dataset: str, categories: Sequence[str]) -> None:
    """Print the cleanliness of a table's methods on some categories of a data set."""
    found: dict[tuple[str, ...], dict[str, tuple[float, float]]] = {}
    some_hidden = any(one.protocol == "partial" for one in table.series(dataset))
    for category in categories:
        for one in table.series(dataset):
            cell = table.cell(one, dataset, category) if one.distance in COLUMNS else None
            if cell is not None:
                hidden = (f"{one.occlusion:.0%}" if one.protocol == "partial" else "",) if some_hidden else ()
                names = (category, one.model, label(one), *hidden)
                found.setdefault(names, {})[one.distance] = cell.value, cell.percentile_95
    heads = ("category", "model", "method", *(("hidden",) if some_hidden else ()))
    print_cleanliness(output, dataset, heads, list(found.items()))


def _cell(value: tuple[float, float] | None, which: int, factor: float) -> float | None:
    """Return the mean (0) or the 95th percentile (1), to four digits after the point."""
    return None if value is None else round(factor * value[which], 4)
