"""Printed ablations: the paper's table, its figure, and what each part does."""

from __future__ import annotations

from collections.abc import Iterator

from kpred.evaluation.page import Page, with_interval
from kpred.evaluation.tables.ablation_table import effects
from kpred.evaluation.tables.cleanliness_pages import cleanliness_pages
from kpred.evaluation.tables.page_parts import best_of, by_metric, errors_of, hidden, label, pivot, short, shown
from kpred.evaluation.tables.scorer import FULL, PARTIAL
from kpred.evaluation.tables.table import Series, Table
from kpred.training.ablations import ROWS


def ablation_pages(table: Table, dataset: str) -> Iterator[Page]:
    """Lay out the ablations of one data set."""
    yield from _full(table, dataset)
    partial = by_metric([one for one in errors_of(table, dataset) if one.protocol == PARTIAL])
    for category in table.categories(dataset) if partial else ():
        yield pivot(
            table,
            dataset,
            category,
            f"{dataset}, {category}, partial shapes: {best_of(table)}",
            ["distance", "CB", "method"],
            partial,
            lambda one: (short(one.metric), "yes" if one.model == "with-cb" else "no", label(one)),
            lambda one: f"{one.occlusion:.0%} hidden",
        )
    yield from cleanliness_pages(table, dataset, table.categories(dataset)[-1:])
    yield from _effects(table, dataset)


def _full(table: Table, dataset: str) -> Iterator[Page]:
    series = [one for one in errors_of(table, dataset) if one.protocol == FULL]
    if not series:
        return
    categories = table.categories(dataset)
    yield Page(
        f"{dataset}, whole shapes: CD, {best_of(table)}",
        ["row", "GSA", "DAR", "LGF", "method", *categories],
        [
            [one.model, *_marks(one), label(one), *(shown(table.cell(one, dataset, name)) for name in categories)]
            for one in sorted(series, key=lambda one: one.method)
        ],
    )


def _marks(series: Series) -> list[str]:
    row = ROWS[series.model]
    return ["yes" if part else "no" for part in (row.gsa, row.dar, row.lgf)]


def _effects(table: Table, dataset: str) -> Iterator[Page]:
    found = [one for one in effects(table) if one.comparison.dataset == dataset]
    if not found:
        return
    yield Page(
        "what each part does: error with it / without it, 95 % paired bootstrap; Wilcoxon signed-rank test",
        ["data", "part", "rows", "method", "distance", "hidden", "n", "ratio", "p"],
        [
            [
                one.comparison.dataset,
                one.part,
                f"{one.without} -> {one.having}",
                label(one.comparison.series),
                short(one.comparison.series.metric),
                hidden(one.comparison.series),
                one.comparison.n,
                with_interval(one.comparison.ratio, one.comparison.low, one.comparison.high, 3),
                one.comparison.p_value,
            ]
            for one in found
        ],
    )
