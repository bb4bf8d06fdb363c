"""What makes a mesh CAD: its parts, where they touch, what mirrors what, and which of its facets are planar."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from kpred.ops.typing import Bool, Float, Int


def _no_ranges() -> np.ndarray:
    return np.zeros((0, 4))


@dataclass(frozen=True, eq=False)
class Structure:
    """Structure of a mesh of V vertices, F faces, C parts, M contact points; frame of the vertices.

    Attributes:
        vertex_parts: (V,) part of each vertex, 0 to C - 1.
        facets: (F,) number of the planar facet that each face belongs to; -1 for faces of curved surfaces.
        axes: (C, 3, 3) rows are the directions of each part's own box; the identity for parts along the axes.
        boxes: (C, 2, 3) lowest and highest coordinates of each part along its own axes.
        curved: (C,) whether most of the part's area is curved.
        contact_parts: (M, 2) the two parts that touch at each contact point; contact_points: (M, 3). Two parts that
            touch have two contact points, the corners of the box in which they do.
        mirror: x of the mirror plane; NaN where the mesh is not mirror symmetric.
        mirrored_parts: (C,) the part that mirrors each part (itself, if it is symmetric); -1 for none.
        affine_ranges: (R, 4) part, axis, low, high: along this axis, what the part has between these coordinates is
            oblique or curved, and stays planar or round only under maps that are affine there.
        ends_only: (C, 3) whether a part has vertices at its two ends alone along each axis, as a board has.
    """

    vertex_parts: Int[np.ndarray, " vertices"]
    facets: Int[np.ndarray, " faces"]
    axes: Float[np.ndarray, "parts 3 3"]
    boxes: Float[np.ndarray, "parts 2 3"]
    curved: Bool[np.ndarray, " parts"]
    contact_parts: Int[np.ndarray, "contacts 2"]
    contact_points: Float[np.ndarray, "contacts 3"]
    mirror: float
    mirrored_parts: Int[np.ndarray, " parts"]
    ends_only: Bool[np.ndarray, "parts 3"]
    affine_ranges: Float[np.ndarray, "ranges 4"] = field(default_factory=_no_ranges)

    @property
    def parts(self) -> int:
        """Number of parts."""
        return len(self.curved)
