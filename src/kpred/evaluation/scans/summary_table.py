"""Summaries as cells of a printed table: looked up by data set, category, metric and group."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

from kpred.evaluation.metrics.summary import ALL, Summary
from kpred.evaluation.page import Page

Key = tuple[str, str]
"""Data set and category."""


@dataclass(frozen=True)
class Column:
    """A column of a printed table: its head, and a method of `SummaryTable` with the metric and group that it shows."""

    head: str
    cell: Callable[..., object]
    metric: str
    group: str = ALL


class SummaryTable:
    """Summaries by data set and category; `group` says which of the scans, `all` by default."""

    def __init__(self, summaries: Sequence[Summary]) -> None:
        self._found = {(s.dataset, s.category, s.metric, s.group): s for s in summaries}

    def lines(self, metric: str) -> list[tuple[str, Key]]:
        """List name and key of all data that have this metric."""
        keys = dict.fromkeys((dataset, category) for dataset, category, name, _ in self._found if name == metric)
        return [("/".join(key), key) for key in keys]

    def page(self, title: str, metric: str, columns: Sequence[Column]) -> Page:
        """Lay out a line for all data that have this metric."""
        rows = [
            (name, *(column.cell(key, column.metric, column.group) for column in columns))
            for name, key in self.lines(metric)
        ]
        return Page(title, ["data", *(column.head for column in columns)], rows)

    def value(self, key: Key, metric: str, group: str = ALL) -> float | None:
        """Look up a value; None where nothing was measured."""
        found = self._found.get((*key, metric, group))
        return None if found is None else found.value

    def count(self, key: Key, metric: str, group: str = ALL) -> int | None:
        """Look up the number of scans."""
        found = self._found.get((*key, metric, group))
        return None if found is None else found.n

    def interval(self, key: Key, metric: str, group: str = ALL) -> str:
        """Write value and interval, as 0.85 0.71–0.93."""
        found = self._found.get((*key, metric, group))
        if found is None:
            return ""
        return f"{found.value:.2f}" + ("" if found.low is None else f" {found.low:.2f}–{found.high:.2f}")

    def counted(self, key: Key, metric: str, group: str) -> str:
        """Write hits of all, as 17/20."""
        found = self._found.get((*key, metric, group))
        return "" if found is None else f"{round(found.value * found.n)}/{found.n}"

    def percent(self, key: Key, metric: str, group: str = ALL) -> float | None:
        """Look up a fraction, in percent."""
        found = self.value(key, metric, group)
        return None if found is None else 100 * found
