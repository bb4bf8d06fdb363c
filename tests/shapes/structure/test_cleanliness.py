"""Cleanliness: nothing is lost where nothing was, each loss shows in its measure, and by the right amount."""

from __future__ import annotations

import dataclasses
import json
from pathlib import Path

import numpy as np
import pytest
import trimesh
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components
from scipy.spatial.transform import Rotation

from kpred.shapes.mesh import Mesh
from kpred.shapes.pack import MeshPack
from kpred.shapes.structure.cleanliness import Cleanliness, measure_cleanliness, thickness_ratios
from kpred.shapes.structure.facets import planar_facets
from kpred.shapes.structure.structure import Structure
from kpred.synthetic.generator import generate

Boxes = list[tuple[tuple[float, float, float], tuple[float, float, float]]]

TABLE: Boxes = [
    ((1.2, 0.05, 0.8), (0.0, 0.725, 0.0)),
    *[((0.06, 0.7, 0.06), (x, 0.35, z)) for x in (-0.5, 0.5) for z in (-0.3, 0.3)],
]
TABLE_MIRRORS = [0, 3, 4, 1, 2]


def _boxes(boxes: Boxes, pieces: int = 1) -> tuple[np.ndarray, np.ndarray]:
    made = []
    for sides, middle in boxes:
        mesh = trimesh.creation.box(sides)
        for _ in range(pieces - 1):
            mesh = mesh.subdivide()
        made.append((np.array(mesh.vertices) + middle, np.array(mesh.faces)))
    starts = np.cumsum([0] + [len(v) for v, _ in made])
    return np.vstack([v for v, _ in made]), np.vstack([f + start for (_, f), start in zip(made, starts)])


def _sheet() -> tuple[np.ndarray, np.ndarray]:
    """A square of 25 vertices in the plane y = 0 whose faces point down."""
    x, z = (grid.reshape(-1) for grid in np.meshgrid(np.linspace(0, 1, 5), np.linspace(0, 1, 5)))
    cells = [5 * i + j for i in range(4) for j in range(4)]
    faces = np.array([f for c in cells for f in ([c, c + 1, c + 5], [c + 1, c + 6, c + 5])])
    return np.column_stack([x, np.zeros(25), z]), faces


def _structure(vertices: np.ndarray, faces: np.ndarray, mirrored: list[int] | None = None) -> Structure:
    """Connected components as parts; parts whose boxes meet touch in the middle of where they do."""
    ends = faces[:, [0, 1, 2]].reshape(-1), faces[:, [1, 2, 0]].reshape(-1)
    graph = coo_matrix((np.ones(len(ends[0])), ends), shape=(len(vertices), len(vertices)))
    count, parts = connected_components(graph, directed=False)
    boxes = np.array([[vertices[parts == c].min(axis=0), vertices[parts == c].max(axis=0)] for c in range(count)])
    low = np.maximum(boxes[:, None, 0], boxes[None, :, 0])
    high = np.minimum(boxes[:, None, 1], boxes[None, :, 1])
    touching = np.argwhere(np.triu((low <= high + 1e-6).all(axis=2), 1))
    return Structure(
        vertex_parts=parts.astype(np.int64),
        facets=planar_facets(vertices, faces),
        axes=np.tile(np.eye(3), (count, 1, 1)),
        boxes=boxes.reshape(-1, 2, 3),
        curved=np.zeros(count, bool),
        contact_parts=touching.reshape(-1, 2),
        contact_points=((low + high) / 2)[touching[:, 0], touching[:, 1]].reshape(-1, 3),
        mirror=float("nan") if mirrored is None else 0.0,
        mirrored_parts=np.full(count, -1) if mirrored is None else np.array(mirrored),
        ends_only=np.ones((count, 3), bool),
    )


def _values(measures: Cleanliness) -> np.ndarray:
    return np.array([value for value in dataclasses.astuple(measures) if value is not None], float)


def _assert_nothing_lost(mesh: Mesh) -> None:
    vertices = mesh.vertices.astype(np.float64)
    structure = _structure(vertices, mesh.faces)
    for result in (vertices, vertices * 0.4 + [3.0, 1.0, 2.0]):
        assert _values(measure_cleanliness(vertices, result, mesh.faces, structure)) == pytest.approx(0.0, abs=1e-6)


SHEAR = np.array([[1.0, 0.2, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]])


@pytest.mark.parametrize("scales", [(1, 1, 1), (3.7, 3.7, 3.7), (1.5, 0.6, 1.0), (0.2, 1.0, 4.0)])
@pytest.mark.parametrize("pieces", [1, 3])
def test_moving_and_scaling_along_the_axes_loses_nothing(scales: tuple[float, float, float], pieces: int) -> None:
    vertices, faces = _boxes(TABLE, pieces)
    structure = _structure(vertices, faces, TABLE_MIRRORS)
    assert len(structure.contact_points) == 4
    measured = measure_cleanliness(vertices, vertices * scales + [5.0, -2.0, 0.3], faces, structure)
    assert _values(measured) == pytest.approx(0.0, abs=1e-6)
    assert measured.mirror is not None


@pytest.mark.parametrize("category", ["chair", "table", "cabinet"])
def test_generated_furniture_loses_nothing_when_moved_and_scaled(category: str) -> None:
    for mesh in generate(category, 6, seed=2):
        _assert_nothing_lost(mesh)


@pytest.mark.parametrize("category", ["chair", "table", "cabinet"])
def test_infinigen_furniture_loses_nothing_when_moved_and_scaled(category: str, shared_data: Path) -> None:
    pack = MeshPack.load(shared_data / "infinigen" / f"{category}.npz")
    for i in range(0, len(pack), 300):
        _assert_nothing_lost(pack[i])


def test_winding_and_the_place_of_the_source_do_not_matter(rng: np.random.Generator) -> None:
    vertices, faces = _boxes(TABLE, 2)
    wound = np.where(rng.random((len(faces), 1)) < 0.5, faces[:, ::-1], faces)
    structure = _structure(vertices, faces)
    result = vertices @ SHEAR.T + rng.normal(0, 0.004, vertices.shape)
    result[structure.vertex_parts == 2] *= [-1, 1, 1]
    expected = _values(measure_cleanliness(vertices, result, faces, structure))
    far = vertices * 7.0 + [40.0, -3.0, 11.0]
    found = measure_cleanliness(far, result, wound, _structure(far, wound))
    assert (expected > 0).all()
    assert _values(found) == pytest.approx(expected, rel=1e-6)


def test_a_shear_shows_in_angles_and_leaves_planes_and_lines() -> None:
    vertices, faces = _boxes([((1, 1, 1), (0, 0, 0))], 3)
    measured = measure_cleanliness(vertices, vertices @ SHEAR.T, faces, _structure(vertices, faces))
    tilt = np.degrees(np.arctan(0.2))
    # Of twelve edges, the four along z are no longer square; of six faces, the two along x tilt.
    assert measured.squareness == pytest.approx(tilt / 3)
    assert measured.squareness_95 == pytest.approx(tilt)
    assert measured.part_shear == pytest.approx(tilt)
    assert measured.axis_tilt == pytest.approx(tilt / 3)
    assert measured.axis_tilt_95 == pytest.approx(tilt)
    assert measured.part_box > 0.01
    unharmed = (measured.flatness, measured.straightness, measured.parallelism, measured.folded_faces)
    assert unharmed == pytest.approx((0, 0, 0, 0), abs=1e-6)


def test_bending_a_board_shows_in_flatness_and_straightness() -> None:
    vertices, faces = _boxes([((1.0, 0.05, 0.6), (0, 0, 0))], 4)
    structure = _structure(vertices, faces)
    bent = vertices + np.column_stack([vertices[:, 1] * 0, 0.2 * vertices[:, 0] ** 2, vertices[:, 1] * 0])
    measured = measure_cleanliness(vertices, bent, faces, structure)
    assert measured.straightness > 0.005 and measured.part_box > 0.005
    # Reference: every facet's vertices against the plane of least squares, by singular values.
    losses, areas = [], trimesh.Trimesh(vertices, faces, process=False).area_faces
    for k in range(6):
        own = bent[np.unique(faces[structure.facets == k])]
        off = np.linalg.svd(own - own.mean(axis=0), compute_uv=False)[2] / np.sqrt(len(own))
        losses.append((off / np.ptp(bent, axis=0).max(), areas[structure.facets == k].sum()))
    value, weight = np.array(losses).T
    assert measured.flatness == pytest.approx((value * weight).sum() / weight.sum())
    assert measured.flatness > 0.005


def test_a_rotated_part_tilts_and_stays_a_box_wherever_it_goes() -> None:
    vertices, faces = _boxes([((1.0, 0.5, 0.25), (0, 0, 0))], 2)
    rotated = vertices @ Rotation.from_euler("z", 7, degrees=True).as_matrix().T
    measured = measure_cleanliness(vertices, rotated, faces, _structure(vertices, faces))
    # Faces along x (0.125 each) and y (0.25) tilt, those along z (0.5) do not.
    assert measured.axis_tilt == pytest.approx(7 * 0.375 / 0.875)
    assert measured.axis_tilt_95 == pytest.approx(7)
    rest = dataclasses.replace(measured, axis_tilt=0.0, axis_tilt_95=0.0)
    assert _values(rest) == pytest.approx(0.0, abs=1e-6)
    anywhere = vertices * [2.0, 0.3, 1.1] @ Rotation.random(random_state=3).as_matrix().T
    measured = measure_cleanliness(vertices, anywhere, faces, _structure(vertices, faces))
    assert (measured.part_box, measured.part_shear) == pytest.approx((0, 0), abs=1e-6)
    assert measured.axis_tilt > 5


def test_curved_parts_need_not_stay_boxes() -> None:
    vertices, faces = _boxes([((1.0, 0.5, 0.25), (0, 0, 0))], 2)
    structure = _structure(vertices, faces)
    sheared = vertices @ SHEAR.T
    assert measure_cleanliness(vertices, sheared, faces, structure).part_box > 0.01
    curved = measure_cleanliness(vertices, sheared, faces, dataclasses.replace(structure, curved=np.ones(1, bool)))
    assert curved.part_box == curved.part_shear == 0


def test_a_wedge_is_no_longer_parallel() -> None:
    vertices, faces = _boxes([((1.0, 1.0, 1.0), (0, 0, 0))])
    wedge = vertices * (1 + 0.2 * vertices[:, 1:2] * [1, 0, 0])
    measured = measure_cleanliness(vertices, wedge, faces, _structure(vertices, faces))
    # Of three pairs of sides, those along x lean by atan(0.1) each, to opposite sides.
    assert measured.parallelism == pytest.approx(2 * np.degrees(np.arctan(0.1)) / 3)


def test_one_moved_leg_of_a_pair_breaks_the_mirror_symmetry() -> None:
    vertices, faces = _boxes(TABLE)
    structure = _structure(vertices, faces, TABLE_MIRRORS)
    leg = structure.vertex_parts == 1
    moved = vertices + np.outer(leg, [0, 0, 0.1])
    found = measure_cleanliness(vertices, moved, faces, structure).mirror
    # Eight of forty vertices and their eight partners are 0.1 off.
    assert found == pytest.approx(0.1 * np.sqrt(16 / 40) / 1.2)
    both = moved + np.outer(structure.vertex_parts == 3, [0, 0, 0.1])
    assert measure_cleanliness(vertices, both, faces, structure).mirror == pytest.approx(0, abs=1e-9)
    assert measure_cleanliness(vertices, moved + [3, 0, 0], faces, structure).mirror == pytest.approx(found)
    unsymmetric = _structure(vertices, faces)
    assert measure_cleanliness(vertices, moved, faces, unsymmetric).mirror is None


def test_touching_doors_that_open_alike_keep_the_mirror_symmetry() -> None:
    vertices, faces = _boxes([((0.5, 1.0, 0.02), (-0.25, 0, 0)), ((0.5, 1.0, 0.02), (0.25, 0, 0))])
    structure = _structure(vertices, faces, [1, 0])
    apart = vertices + np.where(structure.vertex_parts[:, None] == 0, [-0.1, 0, 0], [0.1, 0, 0])
    assert measure_cleanliness(vertices, apart, faces, structure).mirror == pytest.approx(0, abs=1e-9)


def test_a_part_that_is_moved_away_leaves_a_gap() -> None:
    vertices, faces = _boxes(TABLE)
    structure = _structure(vertices, faces)
    moved = vertices - np.outer(structure.vertex_parts == 2, [0, 0.06, 0])
    measured = measure_cleanliness(vertices, moved, faces, structure)
    assert measured.contact_gap == pytest.approx(0.06 / 4 / 1.2)
    assert measured.contact_gap_95 == pytest.approx(0.06 / 1.2)
    assert measured.folded_faces == 0 and measured.part_box < 1e-9
    # A shorter leg of which the upper end stays keeps its contact, a longer table top does as well.
    shorter = vertices.copy()
    shorter[(structure.vertex_parts == 2) & (vertices[:, 1] < 0.5), 1] += 0.1
    assert measure_cleanliness(vertices, shorter, faces, structure).contact_gap < 1e-9


def test_a_part_that_is_inside_out_is_folded() -> None:
    vertices, faces = _boxes(TABLE)
    structure = _structure(vertices, faces)
    leg = structure.vertex_parts[:, None] == 3
    inverted = np.where(leg, vertices * [-1, 1, 1] + [2 * 0.5, 0, 0], vertices)
    assert measure_cleanliness(vertices, inverted, faces, structure).folded_faces == 12


def test_faces_that_a_vertex_passes_over_are_folded() -> None:
    vertices, faces = _sheet()
    moved = vertices.copy()
    moved[12] += [0.4, 0, 0.1]
    doubled = np.cross(moved[faces[:, 1]] - moved[faces[:, 0]], moved[faces[:, 2]] - moved[faces[:, 0]])[:, 1]
    backwards = int((doubled > 0).sum())  # all point down in the source
    assert 0 < backwards < 6
    assert measure_cleanliness(vertices, moved, faces, _structure(vertices, faces)).folded_faces == backwards


def test_a_flat_part_that_is_rotated_is_not_folded() -> None:
    sheet, faces = _sheet()
    box, box_faces = _boxes([((1.0, 1.0, 1.0), (0.5, -0.5, 0.5))])
    vertices, both = np.vstack([sheet, box]), np.vstack([faces, box_faces + len(sheet)])
    flipped = vertices.copy()
    flipped[: len(sheet)] = [0, 1, 1] - sheet * [-1, 1, 1]
    assert measure_cleanliness(vertices, flipped, both, _structure(vertices, both)).folded_faces == 0


_FLAT = np.array([[0, 0, 0], [1, 0, 0], [1, 0, 1], [0, 0, 1]], float)


@pytest.mark.parametrize(
    ("source", "result", "faces"),
    [
        (_FLAT[:3], _FLAT[:3] * 2, [[0, 1, 2]]),
        (_FLAT, _FLAT * [1, 5, 0.5], [[0, 1, 2], [0, 2, 3]]),
        (_FLAT, np.ones((4, 3)), [[0, 1, 2], [0, 2, 3]]),
        (np.ones((4, 3)), _FLAT, [[0, 1, 2], [0, 2, 3]]),
        (_FLAT, _FLAT, [[0, 1, 1], [2, 2, 2]]),
        (_FLAT, _FLAT, np.zeros((0, 3), np.int64)),
    ],
)
def test_what_cannot_be_measured_has_lost_nothing(source: np.ndarray, result: np.ndarray, faces: list) -> None:
    triangles = np.array(faces)
    structure = _structure(source, triangles)
    assert _values(measure_cleanliness(source, result, triangles, structure)) == pytest.approx(0.0, abs=1e-6)
    bare = dataclasses.replace(structure, facets=np.full(len(triangles), -1), mirror=0.5)
    assert np.isfinite(_values(measure_cleanliness(source, result, triangles, bare))).all()
    assert (thickness_ratios(source, result, structure, 1.0) == 1.0).all()


def test_measures_are_json() -> None:
    vertices, faces = _boxes(TABLE)
    measured = measure_cleanliness(vertices, vertices @ SHEAR.T, faces, _structure(vertices, faces))
    assert Cleanliness(**json.loads(json.dumps(measured.to_json()))) == measured
    assert measured.to_json()["mirror"] is None


def test_thickness_is_that_across_the_thinnest_axis_beyond_the_scale() -> None:
    vertices, faces = _boxes([((1.0, 0.05, 0.6), (0, 0, 0)), ((0.04, 1.0, 0.5), (0, 2, 0))], 3)
    structure = _structure(vertices, faces)
    ratios = thickness_ratios(vertices, vertices * [4.0, 3.0, 2.0] + 1.0, structure, 2.0)
    assert ratios == pytest.approx([1.5, 2.0])
    shear = np.array([[1, 0.3, 0], [0, 1, 0], [0, 0, 1]])
    rotation = Rotation.random(random_state=5).as_matrix()
    # A shear within the first board's plane; the second board's leans by atan(0.3).
    sheared = thickness_ratios(vertices, vertices @ shear.T @ rotation.T, structure, 1.0)
    assert sheared == pytest.approx([1.0, np.cos(np.arctan(0.3))], rel=1e-5)
    bent = vertices + np.outer(0.3 * vertices[:, 0] ** 2, [0, 1, 0])
    assert thickness_ratios(vertices, bent, structure, 1.0)[0] == pytest.approx(1.0, rel=0.02)


def test_a_leg_that_is_thicker_than_its_likes_breaks_the_repetition() -> None:
    vertices, faces = _boxes(TABLE)
    structure = _structure(vertices, faces)
    leg = structure.vertex_parts == 1
    middle = vertices[leg].mean(axis=0)
    thicker = vertices.copy()
    thicker[leg] += (vertices[leg] - middle) * [0.5, 0, 0]
    found = measure_cleanliness(vertices, thicker, faces, structure).repetition
    side = np.ptp(vertices[leg, 0]) / 1.2
    # One side of one of four legs is off by a half: its distance from the mean over legs and their two thicknesses.
    assert found == pytest.approx(0.5 * side * np.sqrt(3 / 16 / 2))
    alike = vertices * [1.3, 1.0, 0.8]
    assert measure_cleanliness(vertices, alike, faces, structure).repetition == pytest.approx(0, abs=1e-9)
    longer = vertices + np.outer(leg & (vertices[:, 1] < middle[1]), [0, -0.1, 0])
    assert measure_cleanliness(vertices, longer, faces, structure).repetition == pytest.approx(0, abs=1e-9)
