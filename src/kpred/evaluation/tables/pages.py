"""Printed tables: each kind of table as the pages that a reader sees."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence

from kpred.evaluation.methods.kp_red import STRUCTURE, WITHOUT_HINT
from kpred.evaluation.methods.no_learning import NO_LEARNING
from kpred.evaluation.metrics.metric import NO_UNIT
from kpred.evaluation.page import Page, with_interval
from kpred.evaluation.tables.ablation_pages import ablation_pages
from kpred.evaluation.tables.cleanliness_pages import cleanliness_pages
from kpred.evaluation.tables.compare import Comparison
from kpred.evaluation.tables.generalization_pages import generalization_pages
from kpred.evaluation.tables.page_parts import (
    best_of,
    by_metric,
    candidates,
    errors_of,
    hidden,
    label,
    pivot,
    short,
    shown,
)
from kpred.evaluation.tables.published import published_pages
from kpred.evaluation.tables.ranking import CORRELATION, NEARLY_BEST, RANK, TRUE_BEST
from kpred.evaluation.tables.scorer import UNDEFORMED
from kpred.evaluation.tables.table import ALL, Series, Table
from kpred.evaluation.tables.time_pages import time_pages

NOTE = "note: means over the targets and 95 % bootstrap intervals; the paper's numbers are most likely 10^2 times these"


def pages(table: Table) -> Iterator[Page]:
    """Lay out a table by its kind, data set after data set; then what its rows cost."""
    layout = _LAYOUTS[str(table.header["table"])]
    for dataset in table.datasets():
        yield from layout(table, dataset)
        yield from published_pages(table, dataset)
    yield from time_pages(table)


def ratio_pages(table: Table) -> Iterator[Page]:
    """Lay out a table of any protocol in rows: each value beside its ratios to both baselines."""
    columns = ["model", "method", "hidden", "distance", "top k", "value", "/ undeformed", "/ unlearned"]
    sizes = table.header["database_models"]
    for dataset in table.datasets():
        categories = table.categories(dataset)
        for category in categories:
            cells = [table.cell(one, dataset, category) for one in errors_of(table, dataset)]
            rows = [
                (
                    cell.series.model,
                    label(cell.series),
                    hidden(cell.series),
                    short(cell.series.metric),
                    candidates(cell.series),
                    cell.value,
                    *(_ratio(table, cell.series, base, dataset, category) for base in (UNDEFORMED, NO_LEARNING)),
                )
                for cell in cells
                if cell is not None
            ]
            n = sum(subject.dataset == dataset and category in (subject.category, ALL) for subject in table.subjects())
            searched = sizes.get(f"{dataset}/{category}", sum(sizes.values()))
            against = f"{n} targets against {searched} models; {table.header['unit']}, {table.header['frame']}"
            yield Page(f"{dataset} / {category}: {against}", columns, rows)
        yield from cleanliness_pages(table, dataset, categories)
        yield from published_pages(table, dataset)
    yield from time_pages(table)


def comparison_pages(found: Sequence[Comparison]) -> Iterator[Page]:
    """Lay out the errors of a comparison, data set after data set."""
    columns = ["category", "method", "distance", "hidden", "top k", "n", "A", "B", "B / A", "B better", "p"]
    for dataset in dict.fromkeys(one.dataset for one in found):
        yield Page(
            f"{dataset}: B against A; ratio of means, 95 % paired bootstrap; Wilcoxon signed-rank test",
            columns,
            [
                (
                    one.category,
                    label(one.series),
                    short(one.series.metric),
                    f"{one.series.occlusion:.0%}",
                    candidates(one.series),
                    one.n,
                    one.first,
                    one.second,
                    with_interval(one.ratio, one.low, one.high, 3),
                    f"{one.better:.0%}",
                    one.p_value,
                )
                for one in found
                if one.dataset == dataset and one.series.is_error
            ],
        )


def _ratio(table: Table, series: Series, method: str, dataset: str, category: str) -> float | None:
    """Ratio to a baseline under the same condition and distance, and the same top k if the baseline has one."""
    base = next(
        (
            one
            for one in table.series(dataset)
            if one.method == method
            and (one.protocol, one.occlusion) == (series.protocol, series.occlusion)
            and (one.metric.name, one.metric.surface) == (series.metric.name, series.metric.surface)
            and one.metric.top_k in (None, series.metric.top_k)
        ),
        None,
    )
    found = None if base is None else table.ratio(series, base, dataset, category)
    return None if found is None else found.value


def _full(table: Table, dataset: str) -> Iterator[Page]:
    """Categories side by side."""
    categories, series = table.categories(dataset), errors_of(table, dataset)
    base = next((one for one in series if one.method == NO_LEARNING), None)
    yield Page(
        f"{dataset}, whole shapes: CD, {best_of(table)}, known frame unless stated",
        ["model", "method", *categories, "/ no learning"],
        [
            [
                one.model,
                label(one),
                *(shown(table.cell(one, dataset, category)) for category in categories),
                "" if base is None else shown(table.ratio(one, base, dataset, categories[-1])),
            ]
            for one in series
        ],
    )
    yield from _hint(table, dataset)
    yield from cleanliness_pages(table, dataset, categories)


def _hint(table: Table, dataset: str) -> Iterator[Page]:
    """Lay out the error of whole shapes without the hint that nothing is hidden, against that with it."""
    categories, series = table.categories(dataset), errors_of(table, dataset)
    pairs = [
        (one, other)
        for one in series
        for other in series
        if (one.method, other.method) == (WITHOUT_HINT, STRUCTURE)
        and (one.model, one.metric.top_k) == (other.model, other.metric.top_k)
    ]
    if pairs:
        yield Page(
            f"{dataset}, whole shapes: CD of structure without the hint that nothing is hidden / with it",
            ["model", *categories],
            [
                [one.model, *(shown(table.ratio(one, other, dataset, name)) for name in categories)]
                for one, other in pairs
            ],
        )


def _partial(table: Table, dataset: str) -> Iterator[Page]:
    """Occlusions side by side, a page for each category."""
    for category in table.categories(dataset):
        yield pivot(
            table,
            dataset,
            category,
            f"{dataset}, {category}, partial shapes: {best_of(table)}",
            ["distance", "model", "method"],
            by_metric(errors_of(table, dataset)),
            lambda one: (short(one.metric), one.model, label(one)),
            lambda one: f"{one.occlusion:.0%} hidden",
        )
    yield from cleanliness_pages(table, dataset, table.categories(dataset)[-1:])


def _top_k(table: Table, dataset: str) -> Iterator[Page]:
    """Lay out numbers of candidates side by side, a page for each category."""
    for category in table.categories(dataset):
        yield pivot(
            table,
            dataset,
            category,
            f"{dataset}, {category}, whole shapes: CD, {table.header['unit']}, best of the top k",
            ["model", "method"],
            errors_of(table, dataset),
            lambda one: (one.model, label(one).removeprefix("oracle ")),
            _column,
        )
    yield from cleanliness_pages(table, dataset, table.categories(dataset)[-1:])


def _column(series: Series) -> str:
    if series.metric.unit == NO_UNIT:
        return series.metric.name.replace("_", " ")
    return "all" if series.metric.top_k is None else f"top {series.metric.top_k}"


_RANKINGS: tuple[tuple[str, str, tuple[str, ...]], ...] = (
    (
        "fraction of targets whose true best after refinement is in the top k; rank correlation with refined error",
        "order by",
        (TRUE_BEST, CORRELATION, RANK),
    ),
    ("fraction of targets with a model within 5 % of the true best among the first k", "order by", (NEARLY_BEST,)),
    ("best of the top k by tokens, all refined to the end; unit box squared", "method", ()),
)
"""Title, heading of the rows, and metrics; none for errors."""


def _oracle(table: Table, dataset: str) -> Iterator[Page]:
    """Orders and numbers of candidates, pages for each category."""
    for category in table.categories(dataset):
        for title, head, names in _RANKINGS:
            series = [one for one in table.series(dataset) if one.metric.name in names or (one.is_error and not names)]
            yield pivot(
                table,
                dataset,
                category,
                f"{dataset}, {category}: {title}",
                ["model", "hidden", head],
                series,
                lambda one: (one.model, hidden(one), label(one)),
                _column,
            )


def _scan2cad(table: Table, dataset: str) -> Iterator[Page]:
    """Categories side by side."""
    categories = table.categories(dataset)
    count = {name: sum(name in (subject.category, ALL) for subject in table.subjects()) for name in categories}
    yield Page(
        f"{dataset}, real scans: UCD, {best_of(table)}; frame of the annotated CAD model, known unless stated",
        ["distance", "model", "method", *(f"{name} ({count[name]})" for name in categories)],
        [
            [short(one.metric), one.model, label(one), *(shown(table.cell(one, dataset, name)) for name in categories)]
            for one in by_metric(errors_of(table, dataset))
        ],
    )
    yield from cleanliness_pages(table, dataset, categories[-1:])


_LAYOUTS: Mapping[str, Callable[[Table, str], Iterator[Page]]] = {
    "full": _full,
    "partial": _partial,
    "topk": _top_k,
    "oracle": _oracle,
    "scan2cad": _scan2cad,
    "ablation": ablation_pages,
    "generalization": generalization_pages,
}
