"""Parts of printed tables of errors: names of series, cells with intervals, cells of one category by row and column."""

from __future__ import annotations

from collections.abc import Callable, Sequence

from kpred.evaluation.metrics.intervals import Interval
from kpred.evaluation.metrics.metric import CD, FRACTION, NO_UNIT, UCD, WHOLE, Metric
from kpred.evaluation.page import Page, with_interval
from kpred.evaluation.tables.scorer import PARTIAL
from kpred.evaluation.tables.table import Cell, Series, Table

_SHORT = {CD: "CD", UCD: "UCD"}


def short(metric: Metric) -> str:
    """Name a metric in a printed table."""
    name = _SHORT.get(metric.name, metric.name)
    return f"{name}, whole" if metric.surface == WHOLE else name


def label(series: Series) -> str:
    """Name a method in a printed table."""
    return series.method.replace("_", " ")


def hidden(series: Series) -> str:
    """Write the fraction that is hidden, of partial targets."""
    return f"{series.occlusion:.0%}" if series.protocol == PARTIAL else ""


def candidates(series: Series) -> str:
    """Write how many candidates were compared."""
    return "all" if series.metric.top_k is None else str(series.metric.top_k)


def shown(found: Cell | Interval | None) -> str:
    """Write a value with its interval; errors have five digits after the point, all else two."""
    if found is None:
        return ""
    error = isinstance(found, Cell) and found.series.metric.unit not in (FRACTION, NO_UNIT)
    return with_interval(found.value, found.low, found.high, 5 if error else 2)


def errors_of(table: Table, dataset: str) -> list[Series]:
    """List the series that are distances of results from targets."""
    return [one for one in table.series(dataset) if one.is_error]


def by_metric(series: Sequence[Series]) -> list[Series]:
    """Sort series by distance, those from the whole surface last."""
    return sorted(series, key=lambda one: (one.metric.name, one.metric.surface))


def best_of(table: Table) -> str:
    """Write `best of K, UNIT`, for titles."""
    return f"best of {max(table.header['protocol']['top_k'])}, {table.header['unit']}"


def pivot(
    table: Table,
    dataset: str,
    category: str,
    title: str,
    heads: Sequence[str],
    series: Sequence[Series],
    row: Callable[[Series], tuple[str, ...]],
    column: Callable[[Series], str],
) -> Page:
    """Lay out the cells of one category; `row` and `column` place each series, `heads` name the rows."""
    columns = list(dict.fromkeys(column(one) for one in series))
    rows: dict[tuple[str, ...], dict[str, str]] = {}
    for one in series:
        rows.setdefault(row(one), {})[column(one)] = shown(table.cell(one, dataset, category))
    body = [[*name, *(cells.get(heading, "") for heading in columns)] for name, cells in rows.items()]
    return Page(title, [*heads, *columns], body)
