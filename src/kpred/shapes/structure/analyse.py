"""From a mesh to its structure: parts, their own boxes, contacts, symmetry, facets."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from kpred.ops.typing import Bool, Float, Int
from kpred.shapes.structure.affine_ranges import AffineRange, affine_ranges, ends_only
from kpred.shapes.structure.contacts import contacts
from kpred.shapes.structure.facets import planar_facets
from kpred.shapes.structure.own_axes import mirrored_axes, own_axes, symmetric_axes
from kpred.shapes.structure.segmentation import vertex_parts
from kpred.shapes.structure.structure import Structure
from kpred.shapes.structure.symmetry import mirror_symmetry


def find_structure(
    vertices: Float[np.ndarray, "vertices 3"],
    faces: Int[np.ndarray, "faces 3"],
    points: Float[np.ndarray, "points 3"],
    point_faces: Int[np.ndarray, " points"],
) -> Structure:
    """Find the structure of a mesh in its unit box (y up, front +z).

    Args:
        points: samples of its surface; point_faces: the face that each lies on.

    Any mesh has one: a blob is a single curved part, and triangles without area belong to no facet.
    """
    place = np.asarray(vertices, dtype=np.float64)
    part_of = vertex_parts(place, faces)
    face_parts, count = part_of[faces[:, 0]], int(part_of.max()) + 1
    facets = planar_facets(place, faces)
    surface = _Surface.of(place[faces], facets)
    surfaces = [surface.of_part(face_parts == part) for part in range(count)]
    part_low, part_high = np.full((count, 3), np.inf), np.full((count, 3), -np.inf)
    np.minimum.at(part_low, part_of, place)
    np.maximum.at(part_high, part_of, place)
    mirror, partners = mirror_symmetry(part_low, part_high, np.array([one.areas.sum() for one in surfaces]))
    own: list[_OwnBox] = []
    for part, partner in enumerate(partners.tolist()):
        vertices_here = place[part_of == part]
        own.append(_OwnBox.of(surfaces[part], vertices_here, _axes(part, partner, surfaces, own, vertices_here)))
    axes, boxes = np.stack([box.axes for box in own]), np.stack([box.box for box in own])
    everything = np.concatenate([place, np.asarray(points, dtype=np.float64)])
    touching, where = contacts(axes, boxes, everything, np.concatenate([part_of, face_parts[point_faces]]))
    ranges = [(part, *found) for part, box in enumerate(own) for found in box.ranges]
    return Structure(
        vertex_parts=part_of,
        facets=facets,
        axes=axes,
        boxes=boxes,
        curved=np.array([box.curved for box in own]),
        contact_parts=touching,
        contact_points=where,
        mirror=mirror,
        mirrored_parts=partners,
        ends_only=np.stack([box.ends_only for box in own]),
        affine_ranges=np.array(ranges, dtype=np.float64).reshape(-1, 4),
    )


@dataclass(frozen=True, eq=False)
class _Surface:
    """Faces with an area.

    Attributes:
        normals: (F, 3) unit normals by winding; areas: (F,); planar: (F,) 1 for faces of planar facets.
        low, high: (F, 3) corners of each face's box.
    """

    normals: Float[np.ndarray, "faces 3"]
    areas: Float[np.ndarray, " faces"]
    planar: Float[np.ndarray, " faces"]
    low: Float[np.ndarray, "faces 3"]
    high: Float[np.ndarray, "faces 3"]

    @classmethod
    def of(cls, corners: Float[np.ndarray, "faces corners 3"], facets: Int[np.ndarray, " faces"]) -> _Surface:
        """Measure all faces; areas of 0 are kept until `of_part`."""
        cross = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        doubled = np.linalg.norm(cross, axis=1)
        normals = cross / np.maximum(doubled, 1e-30)[:, None]
        planar = (facets >= 0).astype(np.float64)
        return cls(normals, doubled / 2, planar, corners.min(axis=1), corners.max(axis=1))

    def of_part(self, mine: Bool[np.ndarray, " faces"]) -> _Surface:
        """Take the faces of one part that have an area."""
        rows = np.flatnonzero(mine & (self.areas > 0))
        return _Surface(self.normals[rows], self.areas[rows], self.planar[rows], self.low[rows], self.high[rows])


@dataclass(frozen=True, eq=False)
class _OwnBox:
    """One part as `Structure` lists it: its own axes and box, affine ranges (axis, low, high)."""

    curved: bool
    axes: Float[np.ndarray, "3 3"]
    box: Float[np.ndarray, "2 3"]
    ends_only: Bool[np.ndarray, "3"]
    ranges: list[AffineRange]

    @classmethod
    def of(
        cls, surface: _Surface, vertices: Float[np.ndarray, "vertices 3"], axes: Float[np.ndarray, "3 3"]
    ) -> _OwnBox:
        """Compute one part's box along its own axes, by its faces and vertices."""
        local = vertices @ axes.T
        box = np.stack([local.min(axis=0), local.max(axis=0)])
        if (axes == np.eye(3)).all():
            ranges = affine_ranges(surface.normals, surface.low, surface.high)
        else:
            # An oblique part is affine throughout: over all of its box along the world's axes.
            middle, reach = box.mean(axis=0) @ axes, (box[1] - box[0]) / 2 @ np.abs(axes)
            low, high = (middle - reach).tolist(), (middle + reach).tolist()
            ranges = [AffineRange(axis, low[axis], high[axis]) for axis in range(3)]
        curved = float((surface.areas * surface.planar).sum()) < 0.5 * float(surface.areas.sum())
        return cls(curved, axes, box, ends_only(vertices), ranges)


def _axes(
    part: int, partner: int, surfaces: list[_Surface], before: list[_OwnBox], vertices: np.ndarray
) -> Float[np.ndarray, "3 3"]:
    """Find a part's own axes, (3, 3); of parts that mirror each other they mirror each other too."""
    if 0 <= partner < part:
        return mirrored_axes(before[partner].axes)
    surface = surfaces[part]
    found = own_axes(surface.normals, surface.areas, surface.planar, vertices)
    return symmetric_axes(found) if partner == part else found
