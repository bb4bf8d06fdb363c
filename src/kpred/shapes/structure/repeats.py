"""Parts that repeat: the legs, slats, shelves and drawers of a model that have one size."""

from __future__ import annotations

import numpy as np

from kpred.ops.typing import Bool, Float, Int

SAME_SIDE, SAME_FRACTION = 0.01, 0.05
"""Sides are equal if they differ by less than these, over the model's longest side and over the side itself."""

SAMPLED_SIDE = 0.001
"""Sides that differ by less than this, over the model's longest side, are equal however short they are."""

THICKNESS = 0.1
"""Sides shorter than this, over the longest of the model, are thicknesses; longer ones may differ, as drawers do."""


def repeated_parts(
    sides: Float[np.ndarray, "parts sides"], curved: Bool[np.ndarray, " parts"], longest: float
) -> Int[np.ndarray, " parts"]:
    """Assign each part the number of its set of parts of one size; a part that nothing repeats is a set of its own.

    Args:
        sides: of each part's box; curved: whether its surface is; longest: side of the model, in the unit of `sides`.
    """
    sets = np.full(len(sides), -1, np.int64)
    following = 0
    for part in range(len(sides)):
        if sets[part] >= 0:
            continue
        off = np.abs(sides - sides[part])
        allowed = np.clip(SAME_FRACTION * sides[part], SAMPLED_SIDE * longest, SAME_SIDE * longest)
        equal = (off <= allowed).all(axis=1) & (curved == curved[part]) & (sets < 0)
        sets[equal] = following
        following += 1
    return sets


def repeated_thicknesses(
    sides: Float[np.ndarray, "parts sides"], sets: Int[np.ndarray, " parts"], longest: float
) -> Bool[np.ndarray, "parts sides"]:
    """Mark thicknesses of parts that another part of the same set repeats."""
    repeated = np.bincount(sets)[sets] > 1
    found: np.ndarray = repeated[:, None] & (sides < THICKNESS * longest)
    return found
