"""Printed tables of generalization: retrieved and random templates, categories seen in training and held out."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from kpred.evaluation.methods.kp_red import STRUCTURE
from kpred.evaluation.metrics.intervals import ratio_interval
from kpred.evaluation.page import Page, with_interval
from kpred.evaluation.tables.generalization import RANDOM
from kpred.evaluation.tables.scorer import FLOOR, UNDEFORMED
from kpred.evaluation.tables.table import ALL, Series, Subject, Table

SEEN, HELD_OUT = "seen in training", "held out"
_COLUMNS = ("n", "retrieved", "random", "undeformed", "floor", "retrieved / undeformed", "random / retrieved")


def generalization_pages(table: Table, dataset: str) -> Iterator[Page]:
    """Lay out one page for each number of deformed models: categories, then those seen, those held out, and all."""
    held_out = set(table.header["protocol"]["held_out"])
    for k in table.header["protocol"]["top_k"]:
        names = [name for name in table.categories(dataset) if name != ALL]
        groups = {name: {name} for name in names}
        if held_out & set(names):
            groups |= {SEEN: set(names) - held_out, HELD_OUT: set(names) & held_out}
        groups |= {ALL: set(names)} if len(names) > 1 else {}
        rows = [[name, *_line(table, dataset, members, k)] for name, members in groups.items() if members]
        best = f"the best of {k}" if k > 1 else "a single one"
        yield Page(
            f"{dataset}: CD x 1000 with models of the same category, {best}, retrieved or drawn at random",
            ["category", *_COLUMNS],
            rows,
        )
        if groups.get(SEEN) and groups.get(HELD_OUT):
            yield _comparison(table, dataset, groups, k)


def _comparison(table: Table, dataset: str, groups: dict[str, set[str]], k: int) -> Page:
    """Lay out the error of held-out categories against that of seen ones, as it is and beyond the sampling floor."""
    error, floor = (
        {name: _values(table, dataset, groups[name], method, k) for name in (SEEN, HELD_OUT)}
        for method in (STRUCTURE, FLOOR)
    )
    mean = {name: float(np.mean(list(values.values()))) for name, values in error.items()}
    over = {name: mean[name] - float(np.mean(list(floor[name].values()))) for name in error}
    return Page(
        f"{dataset}: held out / seen in training, top {k}",
        ["CD", "CD beyond the sampling floor"],
        [[f"{mean[HELD_OUT] / mean[SEEN]:.2f}", f"{over[HELD_OUT] / over[SEEN]:.2f}"]],
    )


def _line(table: Table, dataset: str, categories: set[str], k: int) -> list[object]:
    retrieved, random, undeformed, floor = (
        _values(table, dataset, categories, method, k) for method in (STRUCTURE, RANDOM, UNDEFORMED, FLOOR)
    )
    means = [f"{1000 * np.mean(list(one.values())):.2f}" for one in (retrieved, random, undeformed, floor)]
    ratios = [_ratio(retrieved, undeformed, table), _ratio(random, retrieved, table)]
    return [len(retrieved), *means, *ratios]


def _ratio(above: dict[Subject, float], below: dict[Subject, float], table: Table) -> str:
    both = [one for one in above if one in below]
    found = ratio_interval([above[one] for one in both], [below[one] for one in both], int(table.header["seed"]))
    return with_interval(found.value, found.low, found.high, 2)


def _values(table: Table, dataset: str, categories: set[str], method: str, k: int) -> dict[Subject, float]:
    def counts(series: Series) -> bool:
        return series.method == method and series.metric.top_k in (None, k)

    return {
        subject: value
        for series, values in table.values.items()
        if counts(series)
        for subject, value in values.items()
        if subject.dataset == dataset and subject.category in categories
    }
