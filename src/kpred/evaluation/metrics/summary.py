"""Summaries: one number over many scans, with its interval and all that is needed to understand it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from kpred.evaluation.metrics.intervals import (
    Interval,
    fraction_interval,
    mean_interval,
    median_interval,
    percentile_95,
    ratio_interval,
)
from kpred.json_output import plain

ALL = "all"
"""Dataset, category or group of what is taken together."""

NO_UNIT = "1"


@dataclass(frozen=True)
class Summary:
    """One number over many scans.

    Attributes:
        dataset, split, category: of the scans; group: which of them, as `symmetry none`, or all.
        metric: what was measured; statistic: `mean`, `median`, `fraction`, `ratio of means` or `95th percentile`.
        unit, frame: how to read the value; n: number of scans.
        low, high: 95 % interval over the scans (`kpred.evaluation.metrics.intervals`); None where there are fewer
    than two.
    """

    dataset: str
    split: str
    category: str
    group: str
    metric: str
    statistic: str
    unit: str
    frame: str
    value: float
    n: int
    low: float | None
    high: float | None

    def to_json(self) -> dict[str, Any]:
        """Plain values; numbers that are not finite become None."""
        return plain(self)


@dataclass(frozen=True)
class Scope:
    """Which scans summaries are about; `seed` is that of the bootstrap. What has no values gets no summary."""

    dataset: str
    split: str
    category: str
    seed: int

    def mean(self, metric: str, values: Sequence[float], unit: str, frame: str, group: str = ALL) -> list[Summary]:
        """Mean of some values."""
        return self._made(values, lambda: mean_interval(values, self.seed), metric, "mean", unit, frame, group)

    def median(self, metric: str, values: Sequence[float], unit: str, frame: str, group: str = ALL) -> list[Summary]:
        """Median of some values."""
        return self._made(values, lambda: median_interval(values, self.seed), metric, "median", unit, frame, group)

    def percentile_95(
        self, metric: str, values: Sequence[float], unit: str, frame: str, group: str = ALL
    ) -> list[Summary]:
        """95th percentile of some values, without an interval: few values say little about their tail."""
        interval = lambda: Interval(percentile_95(values), None, None)  # noqa: E731
        return self._made(values, interval, metric, "95th percentile", unit, frame, group)

    def fraction(self, metric: str, hits: Sequence[bool], frame: str, group: str = ALL) -> list[Summary]:
        """Summarize the fraction of true values."""
        return self._made(hits, lambda: fraction_interval(hits), metric, "fraction", NO_UNIT, frame, group)

    def ratio(
        self, metric: str, above: Sequence[float], below: Sequence[float], frame: str, group: str = ALL
    ) -> list[Summary]:
        """Ratio of the means of paired values."""
        interval = lambda: ratio_interval(above, below, self.seed)  # noqa: E731
        return self._made(above, interval, metric, "ratio of means", NO_UNIT, frame, group)

    def _made(
        self, values: Sequence[Any], interval: Any, metric: str, statistic: str, unit: str, frame: str, group: str
    ) -> list[Summary]:
        if not len(values):
            return []
        found: Interval = interval()
        return [
            Summary(
                self.dataset,
                self.split,
                self.category,
                group,
                metric,
                statistic,
                unit,
                frame,
                found.value,
                len(values),
                found.low,
                found.high,
            )
        ]
