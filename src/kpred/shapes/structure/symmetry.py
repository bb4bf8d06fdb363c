"""Mirror symmetry of a mesh, left to right, part by part."""

from __future__ import annotations

import numpy as np

from kpred.ops.typing import Float, Int

TOLERANCE = 0.02
"""A part mirrors another if no side of its mirrored box lies farther than this from the other's, unit box."""

MIN_AREA_RATIO = 0.85
"""Least ratio of the areas of two parts that mirror each other."""

MIN_MIRRORED = 0.8
"""Fraction of a mesh's area whose parts must have a mirror image for the mesh to be symmetric."""


def mirror_symmetry(
    low: Float[np.ndarray, "parts 3"], high: Float[np.ndarray, "parts 3"], areas: Float[np.ndarray, " parts"]
) -> tuple[float, Int[np.ndarray, " parts"]]:
    """Find the mirror plane's x (NaN for none) and the part that mirrors each (-1 for none); unit box.

    Args:
        low, high: corners of each part's box along the axes; areas: of the parts.
    """
    best, found = float("nan"), np.full(len(areas), -1, np.int32)
    most = MIN_MIRRORED * float(areas.sum())
    largest = int(areas.argmax())
    for plane in ((low[:, 0].min() + high[:, 0].max()) / 2, (low[largest, 0] + high[largest, 0]) / 2):
        partner = _partners(low, high, areas, float(plane))
        mirrored = float(areas[partner >= 0].sum())
        if mirrored > most:
            best, found, most = float(plane), partner, mirrored * (1 + 1e-6)
    return best, found


def _partners(low: np.ndarray, high: np.ndarray, areas: np.ndarray, plane: float) -> np.ndarray:
    """Find the part (C,) that mirrors each across a plane, both ways, or -1."""
    mirrored_low, mirrored_high = low.copy(), high.copy()
    mirrored_low[:, 0], mirrored_high[:, 0] = 2 * plane - high[:, 0], 2 * plane - low[:, 0]
    off = np.maximum(np.abs(mirrored_low[:, None] - low[None]), np.abs(mirrored_high[:, None] - high[None])).max(axis=2)
    ratio = np.minimum(areas[:, None], areas[None]) / np.maximum(np.maximum(areas[:, None], areas[None]), 1e-12)
    off = np.where(ratio >= MIN_AREA_RATIO, off, np.inf)
    nearest = off.argmin(axis=1)
    rows = np.arange(len(areas))
    good = (off[rows, nearest] < TOLERANCE) & (nearest[nearest] == rows)
    return np.where(good, nearest, -1).astype(np.int32)
