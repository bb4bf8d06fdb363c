"""Measures of what a deformation took from a CAD mesh: flatness, right angles, symmetry, rigid parts, contacts."""

from __future__ import annotations

from dataclasses import asdict, dataclass

import numpy as np
from scipy.spatial import cKDTree

from kpred.ops.typing import Float, Int
from kpred.shapes.structure.edge_changes import measure_edges
from kpred.shapes.structure.edge_pairs import face_frames
from kpred.shapes.structure.facet_changes import measure_facets
from kpred.shapes.structure.facets import WELD_TOLERANCE, weld
from kpred.shapes.structure.groups import group_means
from kpred.shapes.structure.part_maps import (
    MIN_EXTENT,
    PartMaps,
    box_residuals,
    find_folded,
    fit_part_maps,
    measure_shears,
    own_extents,
)
from kpred.shapes.structure.repeats import repeated_parts, repeated_thicknesses
from kpred.shapes.structure.structure import Structure
from kpred.shapes.structure.weighted import weighted_mean, weighted_quantile

MIRROR_TOLERANCE = 2e-3
"""Vertices mirror each other if they do so up to this fraction of the source's longest side."""


@dataclass(frozen=True)
class Cleanliness:
    """What a deformed mesh lost against its source; 0 if nothing. Lengths are fractions of its longest side.

    Attributes:
        flatness: RMS distance of planar facets' vertices to their best planes, beyond the source's, mean by area.
        straightness: RMS distance of straight feature chains' vertices to their best lines, likewise, mean by length.
        squareness, squareness_95: degrees by which right dihedral angles changed, mean and 95th percentile by length.
        parallelism: degrees between facets of a part that were parallel, beyond the source's, mean by area.
        axis_tilt, axis_tilt_95: degrees by which facets along the axes tilted off them, by area.
        mirror: RMS distance of vertices to the mirror images of their partners, beyond the source's; None for a source
            without symmetry.
        part_box: RMS distance of parts to rotated copies of the source's, scaled along their own axes, mean by area;
            part_shear: degrees by which their own axes are no longer square, the worst pair of each part, likewise.
            Curved parts are left out.
        contact_gap, contact_gap_95: gap that opened at contact points; parts that slid along each other have none.
        folded_faces: number of faces that point backwards against the movement of their part.
        repetition: RMS difference of the thicknesses of parts of one size, as legs are, from their mean, likewise.
        dihedral_change: degrees by which dihedral angles changed at edges of two faces, mean by length.
    """

    flatness: float
    straightness: float
    squareness: float
    squareness_95: float
    parallelism: float
    axis_tilt: float
    axis_tilt_95: float
    mirror: float | None
    part_box: float
    part_shear: float
    contact_gap: float
    contact_gap_95: float
    folded_faces: int
    repetition: float
    dihedral_change: float

    def to_json(self) -> dict[str, float | int | None]:
        """List the measures by name, as JSON takes them."""
        return asdict(self)


def measure_cleanliness(
    source: Float[np.ndarray, "vertices 3"],
    result: Float[np.ndarray, "vertices 3"],
    faces: Int[np.ndarray, "faces 3"],
    structure: Structure,
) -> Cleanliness:
    """Measure what the result of a deformation lost of its source's cleanliness: fractions and degrees.

    Args:
        source, result: the same vertices in canonical orientation (y up, front +z), of any size and place; finite.
        structure: of the source.

    What cannot be measured, for want of facets, right angles or contacts, has lost nothing; nor have faces that have no
    area in the source or in the result. Weights are areas and lengths of the source.
    """
    low, size = _box(source, faces)
    before, after = _in_unit_box(source, faces), _in_unit_box(result, faces)
    frames = face_frames(before, faces, WELD_TOLERANCE), face_frames(after, faces, WELD_TOLERANCE)
    welded = weld(before, WELD_TOLERANCE)
    facets = measure_facets(before, after, faces, frames, structure)
    edges = measure_edges(before, after, faces, frames, welded)
    maps = fit_part_maps(before, after, structure.vertex_parts, structure.parts)
    extents = own_extents(before, structure.vertex_parts, structure.axes)
    face_parts = structure.vertex_parts[faces[:, 0]]
    rigid = np.where(structure.curved, 0.0, np.bincount(face_parts, frames[0].areas, structure.parts))
    residuals = box_residuals(before, after, structure.vertex_parts, structure.axes, maps)
    shears = measure_shears(maps, structure.axes, extents)
    boxes = (structure.boxes - np.einsum("ckj,j->ck", structure.axes, low)[:, None]) / size
    gaps = contact_gaps(maps, (structure.contact_points - low) / size, structure.contact_parts, structure.axes, boxes)
    flat = np.asarray((extents <= MIN_EXTENT).any(axis=1))
    return Cleanliness(
        flatness=facets.flatness,
        straightness=edges.straightness,
        squareness=edges.squareness,
        squareness_95=edges.squareness_95,
        parallelism=facets.parallelism,
        axis_tilt=facets.axis_tilt,
        axis_tilt_95=facets.axis_tilt_95,
        mirror=_asymmetry(before, after, (structure.mirror - low[0]) / size, structure),
        part_box=weighted_mean(residuals, rigid),
        part_shear=weighted_mean(shears, rigid),
        contact_gap=weighted_mean(gaps, np.ones(len(gaps))),
        contact_gap_95=weighted_quantile(gaps, np.ones(len(gaps)), 0.95),
        folded_faces=int(find_folded(maps, frames[0].normals, frames[1].normals, face_parts, flat).sum()),
        repetition=_repetition(maps, extents, structure),
        dihedral_change=edges.dihedral_change,
    )


def _repetition(maps: PartMaps, extents: np.ndarray, structure: Structure) -> float:
    """Measure the RMS difference of repeated thicknesses from their mean, beyond the source's, unit box."""
    sets = repeated_parts(extents, structure.curved, 1.0)
    thin = repeated_thicknesses(extents, sets, 1.0)
    if not thin.any():
        return 0.0
    sides = extents * np.linalg.norm(maps.linear @ structure.axes.transpose(0, 2, 1), axis=1)
    return max(0.0, _spread(sides, sets, thin) - _spread(extents, sets, thin))


def _spread(sides: np.ndarray, sets: np.ndarray, marked: np.ndarray) -> float:
    """Measure the RMS difference of the marked sides from the means of their sets."""
    off = sides - group_means(sides, sets, int(sets.max()) + 1)[sets]
    return float(np.sqrt((off[marked] ** 2).mean()))


def thickness_ratios(
    source: Float[np.ndarray, "vertices 3"],
    result: Float[np.ndarray, "vertices 3"],
    structure: Structure,
    scale: float,
) -> Float[np.ndarray, " parts"]:
    """Compute by which factor each part grew across its thinnest own axis, beyond a uniform scale.

    Thickness is measured perpendicular to the images of the part's other two axes under its best affine map, so that
    neither a rotation nor a bend nor a shear of a board makes it thicker. 1 for parts that are flat in the source.
    """
    size = max(float(np.ptp(source, axis=0).max(initial=0.0)), 1e-300) if len(source) else 1.0
    before, after = source / size, result / (size * scale)
    maps = fit_part_maps(before, after, structure.vertex_parts, structure.parts)
    extents = own_extents(before, structure.vertex_parts, structure.axes)
    images = maps.linear @ structure.axes.transpose(0, 2, 1)
    part, thin = np.arange(structure.parts), extents.argmin(axis=1)
    normal = np.cross(images[part, :, (thin + 1) % 3], images[part, :, (thin + 2) % 3])
    normal /= np.maximum(np.linalg.norm(normal, axis=1, keepdims=True), 1e-300)
    ratios = np.abs(np.einsum("pi,pi->p", normal, images[part, :, thin]))
    return np.where(extents[part, thin] > MIN_EXTENT, ratios, 1.0)


def _box(vertices: np.ndarray, faces: np.ndarray) -> tuple[np.ndarray, float]:
    """Return lowest corner and longest side of the vertices in use; side 1 for fewer than two points."""
    if not len(faces):
        return np.zeros(3), 1.0
    corners = vertices[faces.reshape(-1)].astype(np.float64)
    low = corners.min(axis=0)
    return low, float((corners.max(axis=0) - low).max()) or 1.0


def _in_unit_box(vertices: np.ndarray, faces: np.ndarray) -> np.ndarray:
    low, size = _box(vertices, faces)
    scaled: np.ndarray = (vertices - low) / size
    return scaled


def _asymmetry(before: np.ndarray, after: np.ndarray, mirror: float, structure: Structure) -> float | None:
    """Measure the RMS distance of vertices to their partners' mirror images, beyond the source's."""
    if np.isnan(mirror):
        return None
    # The part is a fourth coordinate: where parts touch, a vertex has its partner in the part that mirrors its own.
    # Parts that nothing mirrors are one.
    own = np.where(structure.mirrored_parts < 0, -1, np.arange(structure.parts))
    part, wanted = own[structure.vertex_parts], structure.mirrored_parts[structure.vertex_parts]
    image = before * [-1.0, 1.0, 1.0] + [2.0 * mirror, 0.0, 0.0]
    tree = cKDTree(np.column_stack([before, part]))
    partner = tree.query(np.column_stack([image, wanted]), distance_upper_bound=MIRROR_TOLERANCE)[1]
    one = np.flatnonzero(partner < len(before))
    if not len(one):
        return 0.0
    return max(0.0, _mirror_rms(after, one, partner[one]) - _mirror_rms(before, one, partner[one]))


def _mirror_rms(vertices: np.ndarray, one: np.ndarray, other: np.ndarray) -> float:
    apart = vertices[one] - vertices[other]
    apart[:, 0] = vertices[one, 0] + vertices[other, 0]
    # The best plane is half way between partners, on average.
    apart[:, 0] -= apart[:, 0].mean()
    return float(np.sqrt((apart**2).sum(axis=1).mean()))


def contact_gaps(
    maps: PartMaps, points: np.ndarray, contacts: Int[np.ndarray, "contacts 2"], axes: np.ndarray, boxes: np.ndarray
) -> np.ndarray:
    """Measure the growth of the gap at each contact point between the deformed parts.

    Parts may slide along one another: there is no gap as long as they touch. `boxes` are in the frame of the points.
    """
    found = []
    for one, other in ((0, 1), (1, 0)):
        mine, part = contacts[:, one], contacts[:, other]
        carried = maps.carry(points, mine)
        inverse = np.linalg.pinv(maps.linear[part])
        back = np.einsum("pij,pj->pi", inverse, carried - maps.result_means[part]) + maps.source_means[part]
        gaps = []
        for place, target in ((back, carried), (points, points)):
            local = np.einsum("pkj,pj->pk", axes[part], place)
            inside = np.einsum("pkj,pk->pj", axes[part], np.clip(local, boxes[part, 0], boxes[part, 1]))
            nearest = maps.carry(inside, part) if target is carried else inside
            gaps.append(np.linalg.norm(nearest - target, axis=1))
        found.append(np.maximum(gaps[0] - gaps[1], 0.0))
    smallest: np.ndarray = np.minimum(*found)
    return smallest
