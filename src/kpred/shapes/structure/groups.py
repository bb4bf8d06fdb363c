"""Groups of points: their means, covariances and spreads along principal axes, all groups at once."""

from __future__ import annotations

import numpy as np

from kpred.ops.typing import Float, Int


def group_means(
    points: Float[np.ndarray, "points dims"], groups: Int[np.ndarray, " points"], count: int
) -> Float[np.ndarray, "groups dims"]:
    """Average the points of each of `count` groups, in their unit; zeros for empty groups."""
    number = np.maximum(np.bincount(groups, minlength=count), 1)
    sums = [np.bincount(groups, column, count) for column in np.asarray(points, np.float64).T]
    return np.stack(sums, axis=1) / number[:, None]


def group_covariances(
    first: Float[np.ndarray, "points 3"],
    second: Float[np.ndarray, "points 3"],
    groups: Int[np.ndarray, " points"],
    count: int,
) -> Float[np.ndarray, "groups 3 3"]:
    """Compute each group's mean of the products of centred coordinates (first by row, second by column)."""
    left = first - group_means(first, groups, count)[groups]
    right = second - group_means(second, groups, count)[groups]
    products = (left[:, :, None] * right[:, None, :]).reshape(-1, 9)
    return group_means(products, groups, count).reshape(-1, 3, 3)


def group_spreads(
    points: Float[np.ndarray, "points 3"], groups: Int[np.ndarray, " points"], count: int
) -> Float[np.ndarray, "groups 3"]:
    """Compute RMS distances of each group's points from their mean along principal axes, smallest first.

    The first is the RMS distance to the best plane, the root of the sum of the first two's squares that to the best
    line. Zeros for groups of one point and for empty ones.
    """
    spreads: np.ndarray = np.sqrt(np.maximum(np.linalg.eigvalsh(group_covariances(points, points, groups, count)), 0.0))
    return spreads
