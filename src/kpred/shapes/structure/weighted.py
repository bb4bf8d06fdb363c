"""Means and quantiles of weighted values; 0 where there is nothing to weigh."""

from __future__ import annotations

import numpy as np

from kpred.ops.typing import Float


def weighted_mean(values: Float[np.ndarray, " items"], weights: Float[np.ndarray, " items"]) -> float:
    """Average values by weights, in their unit; 0 without any weight."""
    total = float(weights.sum())
    return float((values * weights).sum()) / total if total > 0 else 0.0


def weighted_quantile(
    values: Float[np.ndarray, " items"], weights: Float[np.ndarray, " items"], fraction: float
) -> float:
    """Find the smallest value that at least this fraction of the weight does not exceed; 0 without any weight."""
    weighed = np.flatnonzero(weights > 0)
    if not len(weighed):
        return 0.0
    order = weighed[np.argsort(values[weighed], kind="stable")]
    reached = np.cumsum(weights[order])
    # By rounding the fraction of the sum could exceed what all weights reach.
    index = min(int(np.searchsorted(reached, fraction * reached[-1])), len(order) - 1)
    return float(values[order[index]])
