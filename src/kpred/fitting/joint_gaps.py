"""Whether the parts of a deformed model still touch: what fell apart is no CAD model that a designer keeps."""

from __future__ import annotations

import math
from collections.abc import Sequence
from itertools import product

import numpy as np

from kpred.fitting.candidates import MAX_MODELS
from kpred.fitting.explanation import Deformed, Explanation
from kpred.lru_cache import LruCache
from kpred.refinement.part_points import PartPoints
from kpred.refinement.structure_basis import StructureBasis
from kpred.shapes.structure.cleanliness import contact_gaps
from kpred.shapes.structure.part_maps import fit_part_maps

MAX_GAP = 0.02
"""Gap between parts that touched from which on a result counts as broken, as a fraction of its longest side."""

WORSE = 0.4
"""Log error by which an unbroken candidate may be worse than a broken one and still take its place."""

DOUBT_WIDTH = 0.06
"""Gap beyond `MAX_GAP` at which confidence falls by e."""

_CORNERS = np.array(list(product((0, 1), repeat=3)))

_corners: LruCache[StructureBasis, PartPoints] = LruCache(MAX_MODELS)


def joint_gap(explanation: Explanation) -> float:
    """Measure the gap that opened where parts touched, 95th percentile, as a fraction of the longest side; 0 if none.

    By the images of the corners of the parts' boxes.
    """
    if explanation.structure is None:
        return 0.0
    structure = explanation.structure.basis.structure
    if not len(structure.contact_points):
        return 0.0
    corners = corner_points(explanation.structure.basis)
    moved = corners.moved(explanation.structure.solution)
    maps = fit_part_maps(corners.points, moved, corners.parts, structure.parts)
    gaps = contact_gaps(maps, structure.contact_points, structure.contact_parts, structure.axes, structure.boxes)
    return float(np.quantile(gaps, 0.95)) / max(float(np.ptp(explanation.points, axis=0).max()), 1e-9)


def corner_points(basis: StructureBasis) -> PartPoints:
    """Build the corners (8 C, 3) of the boxes of a model's C parts, cached in memory; unit box."""
    found = _corners.get(basis)
    if found is None:
        structure = basis.structure
        local = np.take_along_axis(structure.boxes, _CORNERS[None], axis=1)
        places = np.einsum("cnk,ckj->cnj", local, structure.axes).reshape(-1, 3)
        found = PartPoints(basis, places, np.repeat(np.arange(structure.parts), len(_CORNERS)))
        _corners.put(basis, found)
    return found


def unbroken_first(deformed: Deformed, order: Sequence[int]) -> list[int]:
    """Put the first unbroken candidate that explains the scan about as well before a first one that is broken."""
    first = deformed.explanations[order[0]]
    if joint_gap(first) <= MAX_GAP:
        return list(order)
    for row in order[1:]:
        one = deformed.explanations[row]
        if one.final and one.score < first.score + WORSE and joint_gap(one) <= MAX_GAP:
            return [row, *(other for other in order if other != row)]
    return list(order)


def joint_factor(gap: float) -> float:
    """Compute the factor in (0, 1] by which a gap between parts lowers confidence."""
    return math.exp(-((max(0.0, gap - MAX_GAP) / DOUBT_WIDTH) ** 2))
