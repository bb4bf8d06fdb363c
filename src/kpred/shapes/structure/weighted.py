"""Means and percentiles of weighted values; 0 where there is nothing to weigh."""

from __future__ import annotations

import numpy as np

from kpred.ops.typing import Float


def weighted_mean(values: Float[np.ndarray, " items"], weights: Float[np.ndarray, " items"]) -> float:
    """Average values by weights, in their unit; 0 without any weight."""
    total = float(weights.sum())
    return float((values * weights).sum()) / total if total > 0 else 0.0


def weighted_percentile(
    values: Float[np.ndarray, " items"], weights: Float[np.ndarray, " items"], percent: float
) -> float:
    """Find the smallest value that this percentage of the weight does not exceed; 0 without any weight."""
    total = float(weights.sum())
    if not total > 0:
        return 0.0
    order = np.argsort(values, kind="stable")
    reached = np.cumsum(weights[order])
    # Less by rounding: the sum of all weights must be reached.
    return float(values[order[np.searchsorted(reached, min(percent / 100.0 * total, reached[-1]))]])
