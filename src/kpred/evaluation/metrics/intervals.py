"""How sure a mean, a ratio of means or a fraction is: 95 % intervals over instances.

Means and ratios: percentile bootstrap, instances drawn with replacement; a ratio draws its pairs together. Fractions:
Wilson's score interval, which is not empty where all instances agree.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from kpred.ops.typing import Float

RESAMPLES = 2000
LEVEL = 0.95
_NORMAL = 1.959963984540054
"""Quantile of the normal distribution that leaves (1 - LEVEL) / 2 above it."""


@dataclass(frozen=True)
class Interval:
    """An estimate and where it lies with 95 % confidence; `low` and `high` are None for fewer than two instances."""

    value: float
    low: float | None
    high: float | None


def mean_interval(values: Sequence[float], seed: int) -> Interval:
    """Mean of at least one value, unit of the values."""
    sample = np.asarray(values, dtype=np.float64)
    return Interval(float(sample.mean()), *_bootstrap(len(sample), lambda rows: sample[rows].mean(axis=1), seed))


def median_interval(values: Sequence[float], seed: int) -> Interval:
    """Median of at least one value, unit of the values."""
    sample = np.asarray(values, dtype=np.float64)

    def median(rows: np.ndarray) -> np.ndarray:
        found: np.ndarray = np.median(sample[rows], axis=1)
        return found

    return Interval(float(np.median(sample)), *_bootstrap(len(sample), median, seed))


def ratio_interval(above: Sequence[float], below: Sequence[float], seed: int) -> Interval:
    """Mean of `above` / mean of `below`; the two are measured on the same instances, in the same order.

    Where all of `below` is 0 the ratio is infinite and has no interval.
    """
    over, under = np.asarray(above, dtype=np.float64), np.asarray(below, dtype=np.float64)
    if over.shape != under.shape:
        raise ValueError(f"A ratio needs pairs, but has {len(over)} and {len(under)} values.")

    if not under.any():
        return Interval(math.inf, None, None)

    def ratio(rows: np.ndarray) -> np.ndarray:
        with np.errstate(divide="ignore", invalid="ignore"):
            found: np.ndarray = over[rows].mean(axis=1) / under[rows].mean(axis=1)
        return found

    return Interval(float(ratio(np.arange(len(over))[None])[0]), *_bootstrap(len(over), ratio, seed))


def fraction_interval(hits: Sequence[bool]) -> Interval:
    """Compute the fraction of true values among at least one."""
    n = len(hits)
    fraction = sum(hits) / n
    if n < 2:
        return Interval(fraction, None, None)
    spread = _NORMAL * math.sqrt(fraction * (1 - fraction) / n + _NORMAL**2 / (4 * n**2))
    middle = fraction + _NORMAL**2 / (2 * n)
    scale = 1 + _NORMAL**2 / n
    # Rounding must not leave a fraction of 0 or 1 outside.
    return Interval(
        fraction, min(max((middle - spread) / scale, 0.0), fraction), max(min((middle + spread) / scale, 1.0), fraction)
    )


def percentile_95(values: Sequence[float]) -> float:
    """Compute the 95th percentile of at least one value; infinite or NaN where a value is not finite."""
    return float(np.percentile(values, 95)) if np.isfinite(values).all() else math.fsum(values)


def _bootstrap(
    count: int, statistic: Callable[[np.ndarray], Float[np.ndarray, " resamples"]], seed: int
) -> tuple[float, float] | tuple[None, None]:
    """Quantiles of a statistic of rows (resamples, count) drawn with replacement."""
    if count < 2:
        return None, None
    tail = (1 - LEVEL) / 2
    low, high = np.quantile(statistic(_resamples(count, seed)), [tail, 1 - tail])
    return float(low), float(high)


@lru_cache(maxsize=4)
def _resamples(count: int, seed: int) -> np.ndarray:
    """Draw rows with replacement; the measures of one table have them in common."""
    rows = np.random.default_rng(seed).integers(count, size=(RESAMPLES, count))
    rows.flags.writeable = False
    return rows
