"""Floor in the scan of one object that a tight box cut out: a bare plane below the object."""

from __future__ import annotations

import numpy as np
from scipy.spatial import ConvexHull, QhullError

from kpred.ops.typing import Float
from kpred.preprocessing.floor_and_wall import MIN_FLOOR_COVERAGE, RoomSurface, is_foot
from kpred.preprocessing.planes import PlanarPatch, object_points

MIN_COVER = 0.4
"""Fraction of the object's footprint that the patch covers at least: plates, rings and stars under columns are less."""

MAX_BELOW = 0.005
"""Fraction of the scan that may lie below the patch: furniture has feet below its lowest board, floors have nothing."""

MAX_THICKNESS = 0.015
"""Half of the patch's, as a fraction of the scan's size: boards that were scanned on both sides are thicker."""

MIN_KNOWN_COVERAGE = 0.6
"""Like `MIN_FLOOR_COVERAGE`, of a patch that lies at the known height of the floor."""


def detect_floor_in_box(
    patch: PlanarPatch, up: Float[np.ndarray, "3"], size: float, level: float | None = None
) -> RoomSurface | None:
    """Find a floor that does not reach beyond the object; None if the patch is more likely the object's own.

    Bottom boards stand on feet or have walls around them. Points under feet and inside of walls stay.

    Args:
        patch: at the bottom, see `find_end_patch`.
        up: unit vector; size: of the scan, in its units.
        level: height of the patch above the known floor, below the object's middle; None where no floor is known.
    """
    rest = patch.height > 1.5 * patch.thickness
    if rest.sum() < 24 or patch.thickness > MAX_THICKNESS * size or is_foot(patch, rest, size):
        return None
    known = level is not None and abs(level) <= max(2.0 * patch.thickness, 0.015 * size)
    if level is not None and not known:
        return None
    footprint = _hull_area(patch.plane[rest])
    if patch.area(patch.wide) < MIN_COVER * footprint or (patch.height < -patch.thickness).mean() > MAX_BELOW:
        return None
    own = object_points(patch, rest, size, MIN_KNOWN_COVERAGE if known else MIN_FLOOR_COVERAGE)
    removed = (patch.inside | (patch.height < -patch.thickness)) & ~own
    # Inside of a closed body the patch is its bottom.
    if patch.area(removed & patch.wide) < MIN_COVER * footprint:
        return None
    return RoomSurface(removed, patch, 0.0)


def _hull_area(plane: Float[np.ndarray, "points 2"]) -> float:
    """Compute the area of the convex hull of points (N, 2), without the outermost half percent per axis."""
    low, high = np.quantile(plane, [0.005, 0.995], axis=0)
    try:
        return float(ConvexHull(plane[((plane >= low) & (plane <= high)).all(axis=1)]).volume)
    except (QhullError, ValueError):
        return 0.0
