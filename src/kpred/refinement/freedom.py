"""Freedom of each part of a model: whether it may lean or bend, its limits of growth, its own box."""

from __future__ import annotations

import numpy as np

from kpred.ops.typing import Float, Int
from kpred.refinement.joints import leaning
from kpred.refinement.structure_basis import StructureBasis

MIN_GROWTH, MAX_GROWTH = 0.25, 4.0
"""Least and largest factor by which a part's side may shrink or grow."""

MIN_SLOPE, MAX_SLOPE = 0.15, 6.0
"""Least and largest slope of the map that is common to all parts."""

MIN_ARC = 0.02
"""A part is bent if its middle is off its ends by more than this fraction of its length."""

MIN_ARC_POINTS = 16
"""Fewest points by which a bend is measured."""

SLENDER = 1.5
"""A part leans and bends along an axis if it is so many times longer along it than across."""


def part_boxes(basis: StructureBasis) -> Float[np.ndarray, "parts 13"]:
    """List own axes (longest first), middle, and 1 for parts that do not lie along the axes."""
    structure = basis.structure
    side = structure.boxes[:, 1] - structure.boxes[:, 0]
    order = np.argsort(-side, axis=1, kind="stable")
    found = np.empty((structure.parts, 13))
    found[:, :9] = np.take_along_axis(structure.axes, order[:, :, None], axis=1).reshape(-1, 9)
    found[:, 9:12] = np.einsum("ck,ckj->cj", structure.boxes.mean(axis=1), structure.axes)
    found[:, 12] = oblique(basis)
    return found


def oblique(basis: StructureBasis) -> Int[np.ndarray, " parts"]:
    """Mark parts whose own axes are not the world's."""
    found: np.ndarray = (basis.structure.axes != np.eye(3)).any(axis=(1, 2)).astype(np.int64)
    return found


def spline_spans(basis: StructureBasis) -> Int[np.ndarray, "parts 3 2"]:
    """List the first and last control of the spline within each part; -1 where only a chord acts on it."""
    spacing = (basis.high - basis.low) / (basis.controls - 2)
    low, high = basis.middle - basis.half, basis.middle + basis.half
    # Control k acts on cells k - 2 to k.
    first = np.floor((low - basis.low) / spacing).astype(np.int64)
    last = np.floor((high - basis.low) / spacing).astype(np.int64) + 2
    found = np.ascontiguousarray(np.clip(np.stack([first, last], axis=2), 0, basis.controls - 1))
    for part, axis, start, end in basis.structure.affine_ranges:
        one, along = int(part), int(axis)
        if start <= low[one, along] + 1e-6 and end >= high[one, along] - 1e-6:
            found[one, along] = -1
    found[basis.structure.ends_only] = -1
    return found


def spline_slopes(basis: StructureBasis) -> Float[np.ndarray, "3 3"]:
    """List the lowest and highest increment of the controls along each axis, and the spacing of the knots."""
    spacing = (basis.high - basis.low) / (basis.controls - 2)
    return np.stack([(MIN_SLOPE - 1) * spacing, (MAX_SLOPE - 1) * spacing, spacing], axis=1)


def possible_leans(basis: StructureBasis) -> Int[np.ndarray, "groups 3"]:
    """List leans of each group along x, y and z: 0 impossible, 1 if the scan shows it, 2 free.

    Parts lean freely where they lean already.
    """
    along = np.take_along_axis(basis.half, basis.lean_axis, axis=1)
    each = np.where(along < SLENDER * basis.half, 0, 1 + leaning(basis.structure, basis.lean_axis))
    # Only what is mapped affinely can be turned as a whole.
    each[(spline_spans(basis)[..., 0] >= 0).any(axis=1)] = 0
    own = _mirrors_itself(basis)
    # What is its own mirror image leans neither to a side nor along one.
    each[own, 0] = 0
    each[own & (basis.lean_axis[:, 1] == 0), 1] = 0
    return _of_groups(basis, each)


def possible_bends(
    basis: StructureBasis, points: Float[np.ndarray, "points 3"], parts: Int[np.ndarray, " points"]
) -> Int[np.ndarray, "groups 3"]:
    """List bends of each group along x, y and z: 1 for parts that are bent that way already.

    Args:
        points: of the model's surface, unit box; parts: theirs. A round bar is curved, but straight: it does not bend.

    Parts that are their own mirror image do not bend to a side.
    """
    along = np.take_along_axis(basis.half, basis.lean_axis, axis=1)
    resolved = ~np.take_along_axis(basis.structure.ends_only, basis.lean_axis, axis=1)
    each = (basis.structure.curved[:, None] & resolved & (along >= SLENDER * basis.half)).astype(np.int64)
    for part, axis in np.argwhere(each):
        mine = points[parts == part]
        each[part, axis] = abs(_arc(mine, int(axis), int(basis.lean_axis[part, axis]))) > MIN_ARC
    each[_mirrors_itself(basis), 0] = 0
    return _of_groups(basis, each)


def _arc(points: np.ndarray, axis: int, along: int) -> float:
    """Height of the arc that points make in one direction along another, over their length."""
    if len(points) < MIN_ARC_POINTS:
        return 0.0
    place = points[:, along]
    half = float(np.ptp(place)) / 2
    if half <= 0:
        return 0.0
    q = (place - (place.min() + place.max()) / 2) / half
    columns = np.stack([np.ones_like(q), q, q**2], axis=1)
    return float(np.linalg.lstsq(columns, points[:, axis], rcond=None)[0][2]) / (2 * half)


def growth_limits(basis: StructureBasis) -> Float[np.ndarray, "parts 3 3"]:
    """List the lowest and highest growth of each part's sides, and their half side; unit box."""
    half = basis.half
    return np.ascontiguousarray(np.stack([2 * half * (MIN_GROWTH - 1), 2 * half * (MAX_GROWTH - 1), half], axis=2))


def _of_groups(basis: StructureBasis, each: np.ndarray) -> np.ndarray:
    """Reduce what each part may do to what all parts of its group may do."""
    found = np.full((int(basis.group.max()) + 1, 3), 2, np.int64)
    np.minimum.at(found, basis.group, each)
    return found


def _mirrors_itself(basis: StructureBasis) -> np.ndarray:
    structure = basis.structure
    found: np.ndarray = np.isfinite(structure.mirror) & (structure.mirrored_parts == np.arange(structure.parts))
    return found
