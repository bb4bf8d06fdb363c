"""From a mesh to its structure: parts, their own boxes, contacts, symmetry, facets."""

from __future__ import annotations

import numpy as np

from kpred.ops.typing import Float, Int
from kpred.shapes.structure.affine_ranges import affine_ranges, ends_only
from kpred.shapes.structure.contacts import contacts
from kpred.shapes.structure.facets import planar_facets
from kpred.shapes.structure.own_axes import own_axes
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
    facets = planar_facets(place, faces)
    corners = place[faces]
    cross = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    doubled = np.linalg.norm(cross, axis=1)
    normals = cross / np.maximum(doubled, 1e-30)[:, None]
    face_parts, count = part_of[faces[:, 0]], int(part_of.max()) + 1
    low, high = corners.min(axis=1), corners.max(axis=1)
    axes, boxes = np.tile(np.eye(3), (count, 1, 1)), np.zeros((count, 2, 3))
    curved, area, ranges = np.zeros(count, bool), np.zeros(count), []
    ends = np.zeros((count, 3), bool)
    for part in range(count):
        mine, own = np.flatnonzero((face_parts == part) & (doubled > 0)), place[part_of == part]
        areas, planar = doubled[mine] / 2, (facets[mine] >= 0).astype(np.float64)
        area[part] = areas.sum()
        curved[part] = float((areas * planar).sum()) < 0.5 * area[part]
        axes[part] = own_axes(normals[mine], areas, planar, own)
        local = own @ axes[part].T
        ends[part] = ends_only(own)
        boxes[part] = local.min(axis=0), local.max(axis=0)
        if (axes[part] == np.eye(3)).all():
            found = affine_ranges(normals[mine], low[mine], high[mine])
        else:
            middle = boxes[part].mean(axis=0) @ axes[part]
            reach = (boxes[part, 1] - boxes[part, 0]) / 2 @ np.abs(axes[part])
            found = [(axis, float(middle[axis] - reach[axis]), float(middle[axis] + reach[axis])) for axis in range(3)]
        ranges += [(part, *one) for one in found]
    everything = np.concatenate([place, np.asarray(points, dtype=np.float64)])
    touching, where = contacts(axes, boxes, everything, np.concatenate([part_of, face_parts[point_faces]]))
    part_low, part_high = np.full((count, 3), np.inf), np.full((count, 3), -np.inf)
    np.minimum.at(part_low, part_of, place)
    np.maximum.at(part_high, part_of, place)
    mirror, partners = mirror_symmetry(part_low, part_high, area)
    return Structure(
        vertex_parts=part_of,
        facets=facets,
        axes=axes,
        boxes=boxes,
        curved=curved,
        contact_parts=touching,
        contact_points=where,
        mirror=mirror,
        mirrored_parts=partners,
        ends_only=ends,
        affine_ranges=np.array(ranges, dtype=np.float64).reshape(-1, 4),
    )
