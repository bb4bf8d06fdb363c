"""Ranges along each axis over which the map of a part must be affine, so that facets stay planar.

A map x' = f(x), y' = g(y), z' = h(z) keeps every facet along the axes planar, whatever f, g and h are. A facet whose
normal has a component along x and others stays planar only where f is affine over the x that the facet covers.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from kpred.ops.typing import Bool, Float

OBLIQUE = np.sin(np.radians(1.5))
"""Components of a unit normal below this count as none."""

_JOINED = 0.01
"""Ranges that are so near to each other are one, unit box."""


class AffineRange(NamedTuple):
    """A range along an axis (0, 1, 2), in the unit box."""

    axis: int
    low: float
    high: float


def affine_ranges(
    normals: Float[np.ndarray, "faces 3"], low: Float[np.ndarray, "faces 3"], high: Float[np.ndarray, "faces 3"]
) -> list[AffineRange]:
    """Find the ranges of one part along each axis over which its map must be affine.

    Args:
        normals: unit normals of the part's faces; low, high: corners of each face's box, unit box.
    """
    found = []
    for axis in range(3):
        component = np.abs(normals[:, axis])
        oblique = (component > OBLIQUE) & (component < 1 - OBLIQUE**2)
        order = np.flatnonzero(oblique)[np.argsort(low[oblique, axis], kind="stable")]
        if not len(order):
            continue
        starts, ends = low[order, axis], np.maximum.accumulate(high[order, axis])
        breaks = np.flatnonzero(starts[1:] > ends[:-1] + _JOINED) + 1
        for run in np.split(np.arange(len(order)), breaks):
            found.append(AffineRange(axis, float(starts[run[0]]), float(ends[run[-1]])))
    return found


def ends_only(vertices: Float[np.ndarray, "vertices 3"]) -> Bool[np.ndarray, "3"]:
    """Mark the axes along which a part has vertices at its two ends alone, as a board has."""
    low, high = vertices.min(axis=0), vertices.max(axis=0)
    inside = (vertices > low + _JOINED) & (vertices < high - _JOINED)
    found: np.ndarray = ~inside.any(axis=0)
    return found
