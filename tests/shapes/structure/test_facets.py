"""Planar facets: what they are on known solids, and what must not change them."""

from __future__ import annotations

import numpy as np
import pytest
import trimesh
from scipy.spatial.transform import Rotation

from kpred.shapes.structure.facets import planar_facets, weld
from kpred.synthetic.generator import generate


def _box(sides: tuple[float, float, float] = (1.0, 0.5, 0.2), pieces: int = 1) -> tuple[np.ndarray, np.ndarray]:
    mesh = trimesh.creation.box(sides)
    for _ in range(pieces - 1):
        mesh = mesh.subdivide()
    return np.array(mesh.vertices), np.array(mesh.faces)


def _prism(sides: int, height: float = 1.0) -> tuple[np.ndarray, np.ndarray]:
    mesh = trimesh.creation.cylinder(1.0, height, sections=sides)
    return np.array(mesh.vertices), np.array(mesh.faces)


def _panel(bends: list[float], widths: list[float]) -> tuple[np.ndarray, np.ndarray]:
    """Strips of a sheet along z, 1 deep, that bend by degrees between strips of these widths."""
    angles = np.radians(np.cumsum([0.0, *bends]))
    steps = np.array(widths)[:, None] * np.column_stack([np.cos(angles), np.sin(angles)])
    profile = np.vstack([[0.0, 0.0], np.cumsum(steps, axis=0)])
    vertices = np.vstack([np.column_stack([profile, np.full(len(profile), z)]) for z in (0.0, 1.0)])
    n = len(profile)
    faces = [f for k in range(n - 1) for f in ([k, k + 1, n + k], [k + 1, n + k + 1, n + k])]
    return vertices, np.array(faces)


def _soup(vertices: np.ndarray, faces: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    return vertices[faces].reshape(-1, 3), np.arange(3 * len(faces)).reshape(-1, 3)


def _rounded_box(segments: int, radius: float) -> tuple[np.ndarray, np.ndarray]:
    """A square rod along z whose four edges along z are filleted."""
    quarter = np.linspace(0, np.pi / 2, segments + 1)
    corners = [(1, 1), (-1, 1), (-1, -1), (1, -1)]
    ring = np.vstack(
        [
            np.array(corner) * (1 - radius)
            + radius * np.column_stack([np.cos(quarter + k * np.pi / 2), np.sin(quarter + k * np.pi / 2)])
            for k, corner in enumerate(corners)
        ]
    )
    n = len(ring)
    vertices = np.vstack([np.column_stack([ring, np.full(n, z)]) for z in (-1.0, 1.0)])
    sides = [f for k in range(n) for f in ([k, (k + 1) % n, n + k], [(k + 1) % n, n + (k + 1) % n, n + k])]
    caps = [f for k in range(1, n - 1) for f in ([0, k, k + 1], [n, n + k, n + k + 1])]
    return vertices, np.array(sides + caps)


def _reference(vertices: np.ndarray, faces: np.ndarray) -> np.ndarray:
    """Facets of a mesh without curved surfaces, by comparing all pairs of faces."""
    near = np.linalg.norm(vertices[:, None] - vertices[None], axis=2) < 1e-5 * np.ptp(vertices, axis=0).max()
    position = near.argmax(axis=1)[faces]
    normals = trimesh.Trimesh(vertices, faces, process=False).face_normals
    label = np.arange(len(faces))
    for i in range(len(faces)):
        parallel = np.linalg.norm(np.cross(normals[i], normals), axis=1) < 1e-3
        common = (position[:, :, None] == position[i]).any(axis=2).sum(axis=1)
        for j in np.flatnonzero(parallel & (common >= 2)):
            label[label == label[i]] = label[j]
    return np.unique(label, return_inverse=True)[1].reshape(-1)


def _same_partition(first: np.ndarray, second: np.ndarray) -> bool:
    if not ((first < 0) == (second < 0)).all():
        return False
    pairs = np.unique(np.column_stack([first, second]), axis=0)
    return len(pairs) == len(np.unique(first)) == len(np.unique(second))


def test_weld_agrees_with_clusters_that_were_spread_within_the_tolerance(rng: np.random.Generator) -> None:
    tolerance = 1e-3
    centres = np.stack(np.meshgrid(*[np.arange(4)] * 3), axis=-1).reshape(-1, 3) * 2.5 * tolerance
    cluster = np.concatenate([np.arange(64), rng.integers(0, 64, 500)])
    spread = rng.uniform(-1, 1, (len(cluster), 3)) * tolerance / 8 / np.sqrt(12)
    found = weld(centres[cluster] + spread, tolerance)
    assert (found == cluster).all()  # numbered by first appearance


def test_weld_chains_steps_and_keeps_equal_positions_alone_at_tolerance_zero() -> None:
    line = np.column_stack([np.arange(50) * 0.9e-3, np.zeros(50), np.zeros(50)])
    assert (weld(line, 1e-3) == 0).all()
    assert (weld(np.vstack([line, line[::-1]]), 0.0) == np.concatenate([np.arange(50), np.arange(50)[::-1]])).all()
    assert len(weld(np.zeros((0, 3)), 1e-3)) == 0


@pytest.mark.parametrize("pieces", [1, 3])
def test_a_box_has_six_facets(pieces: int) -> None:
    vertices, faces = _box(pieces=pieces)
    found = planar_facets(vertices, faces)
    assert sorted(np.bincount(found).tolist()) == [len(faces) // 6] * 6
    normals = trimesh.Trimesh(vertices, faces, process=False).face_normals
    assert all(np.ptp(normals[found == k], axis=0).max() < 1e-9 for k in range(6))


@pytest.mark.parametrize("category", ["chair", "table", "cabinet"])
def test_cuboid_furniture_agrees_with_all_pairs(category: str) -> None:
    for mesh in generate(category, 3, seed=1, cuboids=1.0):
        vertices = mesh.vertices.astype(np.float64)
        assert _same_partition(planar_facets(vertices, mesh.faces), _reference(vertices, mesh.faces))


def test_facets_depend_on_the_surface_alone(rng: np.random.Generator) -> None:
    pieces = [_box(pieces=2), _prism(24), _prism(6)]
    vertices = np.vstack([v + [3.0 * k, 0, 0] for k, (v, _) in enumerate(pieces)])
    starts = np.cumsum([0] + [len(v) for v, _ in pieces])
    faces = np.vstack([f + start for (_, f), start in zip(pieces, starts)])
    expected = planar_facets(vertices, faces)
    assert expected.max() == 15 and (expected < 0).sum() == 48
    flips = rng.random(len(faces)) < 0.5
    wound = np.where(flips[:, None], faces[:, ::-1], faces)
    assert (planar_facets(vertices, wound) == expected).all()
    assert (planar_facets(*_soup(vertices, wound)) == expected).all()
    moved = vertices @ Rotation.random(random_state=0).as_matrix().T * 37.0 + [1e3, -50.0, 7.0]
    assert (planar_facets(moved, faces) == expected).all()
    assert (planar_facets(vertices.astype(np.float32), faces.astype(np.int32)) == expected).all()
    noisy = vertices + rng.uniform(-1e-6, 1e-6, vertices.shape)
    assert (planar_facets(*_soup(noisy, faces)) == expected).all()
    order = rng.permutation(len(faces))
    assert _same_partition(planar_facets(vertices, faces[order]), expected[order])


def test_facets_are_numbered_by_their_first_faces() -> None:
    found = planar_facets(*_box(pieces=2))
    first = [int((found == k).argmax()) for k in range(6)]
    assert first == sorted(first)


def test_coplanar_boards_that_do_not_touch_are_two_facets() -> None:
    vertices, faces = _panel([], [1.0])
    both = np.vstack([vertices, vertices + [1.1, 0, 0]])
    assert planar_facets(both, np.vstack([faces, faces + 4])).tolist() == [0, 0, 1, 1]


@pytest.mark.parametrize("sides", [12, 16, 64])
@pytest.mark.parametrize("height", [0.02, 1.0, 20.0])
def test_a_cylinder_is_curved_between_two_planar_caps(sides: int, height: float) -> None:
    vertices, faces = _prism(sides, height)
    found = planar_facets(vertices, faces)
    cap = np.abs(trimesh.Trimesh(vertices, faces, process=False).face_normals[:, 2]) > 0.5
    assert ((found >= 0) == cap).all()
    assert found.max() == 1


@pytest.mark.parametrize("sides", [3, 4, 6, 8])
def test_a_prism_of_few_sides_is_planar_throughout(sides: int) -> None:
    found = planar_facets(*_prism(sides))
    assert found.min() == 0 and found.max() == sides + 1


@pytest.mark.parametrize("mesh", [trimesh.creation.icosphere(subdivisions=3), trimesh.creation.torus(1.0, 0.3)])
def test_smooth_solids_have_no_facet(mesh: trimesh.Trimesh) -> None:
    assert (planar_facets(np.array(mesh.vertices), np.array(mesh.faces)) == -1).all()


@pytest.mark.parametrize("segments", [4, 12, 200])
def test_planes_beside_fillets_are_planar_and_fillets_are_not(segments: int) -> None:
    vertices, faces = _rounded_box(segments, 0.05)
    found = planar_facets(vertices, faces)
    normals = trimesh.Trimesh(vertices, faces, process=False).face_normals
    plane = np.abs(normals).max(axis=1) > 1 - 1e-9
    assert ((found >= 0) == plane).all()
    assert found.max() == 5


def test_one_small_bend_leaves_two_planes_and_many_make_a_curved_sheet() -> None:
    assert planar_facets(*_panel([10.0], [1.0, 1.0])).tolist() == [0, 0, 1, 1]
    assert (planar_facets(*_panel([10.0] * 6, [0.2] * 7)) == -1).all()
    # Each bend is too small to see; the sheet spans a tenth of a circle.
    assert (planar_facets(*_panel([0.09] * 400, [0.01] * 401)) == -1).all()


def test_a_board_of_rounded_coordinates_is_one_facet(rng: np.random.Generator) -> None:
    vertices, faces = _box((1.0, 0.4, 0.1), pieces=6)
    rounded = vertices.copy()
    rounded[:, 2] += rng.choice([-2e-5, 2e-5], len(vertices))
    normals = trimesh.Trimesh(rounded, faces, process=False).face_normals
    assert np.degrees(np.arccos(np.abs(normals).max(axis=1))).max() > 0.15
    found = planar_facets(rounded, faces)
    assert found.min() == 0 and found.max() == 5


def test_faces_without_area_separate_nothing_and_follow_their_neighbour() -> None:
    # A square of two sides that meet in a face of no height, from (0, 0) over (0.5, 0) to (1, 0).
    vertices = np.array([[0, 0, 0], [1, 0, 0], [0.5, 0, 0], [0, 1, 0], [1, 1, 0], [0.5, -1, 0]], float)
    faces = np.array([[0, 1, 3], [1, 4, 3], [0, 2, 1], [0, 5, 2], [2, 5, 1], [3, 3, 4], [5, 5, 5]])
    assert planar_facets(vertices, faces).tolist() == [0, 0, 0, 0, 0, 0, -1]
    folded = vertices.copy()
    folded[5] = [0.5, 0, 1]
    found = planar_facets(folded, faces)
    assert found[[0, 1]].tolist() == [0, 0] and found[3] == found[4] == 1


def test_degenerate_meshes_have_no_facets_or_one() -> None:
    triangle = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0]], float)
    assert planar_facets(triangle, np.array([[0, 1, 2]])).tolist() == [0]
    assert planar_facets(triangle, np.array([[0, 1, 1], [2, 2, 2]])).tolist() == [-1, -1]
    assert planar_facets(np.ones((3, 3)), np.array([[0, 1, 2]])).tolist() == [-1]
    assert len(planar_facets(triangle, np.zeros((0, 3), np.int64))) == 0
