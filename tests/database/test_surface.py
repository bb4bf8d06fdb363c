"""The structure in an entry: what is true of every mesh, however bad, and of meshes whose structure is known."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
import torch

from kpred.database import Database, encode_models
from kpred.database.encode import prepare_mesh
from kpred.database.structure_arrays import check_point_structure, check_structure
from kpred.database.surface import analyse_surface
from kpred.nn import KPRed, ModelConfig
from kpred.ops.cage import icosphere
from kpred.shapes.mesh import Mesh

CORNERS = np.array([[x, y, z] for x in (0, 1) for y in (0, 1) for z in (0, 1)], float)
BOX = np.array(
    [[0, 1, 3], [0, 3, 2], [4, 6, 7], [4, 7, 5], [0, 4, 5], [0, 5, 1], [2, 3, 7], [2, 7, 6], [0, 2, 6], [0, 6, 4]]
    + [[1, 5, 7], [1, 7, 3]]
)


def boxes(lows: np.ndarray, sizes: np.ndarray) -> Mesh:
    """Boxes that do not share vertices."""
    vertices = (lows[:, None] + CORNERS * sizes[:, None]).reshape(-1, 3)
    return Mesh(vertices, (BOX + 8 * np.arange(len(lows))[:, None, None]).reshape(-1, 3))


def sheet(cells: int) -> tuple[np.ndarray, np.ndarray]:
    """A square of 2 x cells x cells triangles in the plane z = 0."""
    x, y = np.meshgrid(np.linspace(0, 1, cells + 1), np.linspace(0, 1, cells + 1), indexing="ij")
    corner = (np.arange(cells)[:, None] * (cells + 1) + np.arange(cells)).reshape(-1)
    right, up = corner + cells + 1, corner + 1
    faces = np.concatenate([np.stack([corner, right, right + 1], 1), np.stack([corner, right + 1, up], 1)])
    return np.stack([x, y, np.zeros_like(x)], axis=2).reshape(-1, 3), faces


def blob(rng: np.random.Generator) -> Mesh:
    """One closed surface without a plane in it."""
    vertices, faces = (array.numpy() for array in icosphere(3))
    return Mesh(vertices * rng.uniform(0.6, 1.0, (len(vertices), 1)), faces)


def one_box(rng: np.random.Generator) -> Mesh:
    """A single part."""
    return boxes(np.zeros((1, 3)), np.array([[1.0, 2.0, 0.5]]))


def thousands_of_parts(rng: np.random.Generator) -> Mesh:
    """Slats in a heap."""
    return boxes(rng.uniform(0, 1, (3000, 3)), rng.uniform(0.01, 0.3, (3000, 3)))


def parts_inside_parts(rng: np.random.Generator) -> Mesh:
    """Boxes like the skins of an onion, and the innermost twice."""
    shrink = np.append(np.arange(20), 19)[:, None] * 0.02
    return boxes(np.tile(shrink, 3), 1 - 2 * np.tile(shrink, 3))


def zero_thickness(rng: np.random.Generator) -> Mesh:
    """Two boards without thickness at right angles, and a line of triangles that almost have no area."""
    lows = np.array([[0, 0, 0], [0, 0, 0], [0.2, 0.5, 0.1]])
    return boxes(lows, np.array([[1.0, 0.0, 1.0], [0.0, 1.0, 1.0], [1e-6, 0.3, 1e-6]]))


def flat(rng: np.random.Generator) -> Mesh:
    """All in one plane."""
    vertices, faces = sheet(3)
    return Mesh(vertices, faces)


def large_facet(rng: np.random.Generator) -> Mesh:
    """One plane of 100,000 triangles on a box."""
    vertices, faces = sheet(224)
    box = boxes(np.array([[0, 0, -1.0]]), np.array([[1.0, 1.0, 0.9]]))
    return Mesh(np.concatenate([vertices, box.vertices]), np.concatenate([faces, box.faces + len(vertices)]))


def mixed_winding(rng: np.random.Generator) -> Mesh:
    """A stool whose faces are wound at random."""
    legs = np.array([[0, 0, 0], [0.9, 0, 0], [0, 0, 0.9], [0.9, 0, 0.9], [0, 0.5, 0]])
    mesh = boxes(legs, np.array([[0.1, 0.5, 0.1]] * 4 + [[1.0, 0.1, 1.0]]))
    swap = rng.random(len(mesh.faces)) < 0.5
    return Mesh(mesh.vertices, np.where(swap[:, None], mesh.faces[:, ::-1], mesh.faces))


def stray_and_double_vertices(rng: np.random.Generator) -> Mesh:
    """Every face has vertices of its own, each face is there twice, far vertices belong to none."""
    mesh = mixed_winding(rng)
    faces = np.concatenate([mesh.faces, mesh.faces])
    vertices = np.concatenate([mesh.vertices[faces].reshape(-1, 3), [[50.0, 0, 0], [0, -50.0, 0]]])
    return Mesh(vertices, np.arange(3 * len(faces)).reshape(-1, 3))


def triangle_soup(rng: np.random.Generator) -> Mesh:
    """Triangles anywhere, of any size."""
    middles, offsets = rng.uniform(-1, 1, (2000, 1, 3)), rng.normal(size=(2000, 3, 3))
    vertices = middles + offsets * rng.uniform(1e-4, 0.2, (2000, 1, 1))
    return Mesh(vertices.reshape(-1, 3), np.arange(6000).reshape(-1, 3))


def one_triangle(rng: np.random.Generator) -> Mesh:
    """The least mesh there is."""
    return Mesh(np.array([[0, 0, 0], [1, 0.2, 0], [0, 1, 0.7]]), np.array([[0, 1, 2]]))


def sliver(rng: np.random.Generator) -> Mesh:
    """One triangle that is a thousandth of a millionth as wide as long."""
    return Mesh(np.array([[0, 0, 0], [1, 0, 0], [0.5, 1e-9, 0]]), np.array([[0, 1, 2]]))


def small_far_away(rng: np.random.Generator) -> Mesh:
    """A thin box so far from the origin that float32 leaves it few steps."""
    return boxes(np.array([[1e4, 1e4, 1e4]]), np.array([[0.05, 0.02, 0.5]]))


BAD_MESHES: dict[str, Callable[[np.random.Generator], Mesh]] = {
    make.__name__: make
    for make in (
        blob, one_box, thousands_of_parts, parts_inside_parts, zero_thickness, flat, large_facet, mixed_winding,
        stray_and_double_vertices, triangle_soup, one_triangle, sliver, small_far_away,
    )
}  # fmt: skip


def analyse(mesh, seed=0):
    item = prepare_mesh(mesh, "a", seed)
    faces, points = item.point_faces.numpy(), item.points.numpy()
    return item, analyse_surface(item.vertices.numpy(), item.mesh.faces, points, faces)


def middles(structure):
    return np.einsum("ck,ckj->cj", structure.boxes.mean(axis=1), structure.axes)


@pytest.fixture(scope="module")
def network():
    torch.manual_seed(0)
    config = ModelConfig("chair", token_size=8, width=16, stages=1, region_points=8)
    return KPRed(config).eval().requires_grad_(False)


@pytest.mark.parametrize("name", BAD_MESHES)
def test_every_mesh_has_a_valid_structure(name, rng):
    item, found = analyse(BAD_MESHES[name](rng))
    structure = found.structure
    check_structure(structure, len(item.vertices), len(item.mesh.faces))
    check_point_structure(found.point_parts, found.point_normals, len(item.points), structure.parts)
    assert set(structure.vertex_parts) == set(range(structure.parts)), "no part is empty"
    np.testing.assert_allclose(np.linalg.norm(found.point_normals, axis=1), 1, atol=1e-5)
    corners = item.mesh.faces[item.point_faces.numpy()]
    np.testing.assert_array_equal(found.point_parts, structure.vertex_parts[corners[:, 0]])
    place = item.vertices.numpy().astype(np.float64)[corners]
    for k in (1, 2):
        edge = place[:, k] - place[:, 0]
        along = np.abs(np.einsum("ij,ij->i", edge, found.point_normals))
        assert (along <= 1e-5).all(), "normals are at right angles to their face"
    outward = np.einsum("ij,ij->i", found.point_normals, item.points.numpy() - middles(structure)[found.point_parts])
    assert outward.min() > -1e-6


@pytest.mark.parametrize("name", BAD_MESHES)
def test_every_mesh_is_encoded_and_comes_back(name, rng, network, tmp_path, assert_same):
    (entry,) = encode_models([BAD_MESHES[name](rng)], [name], network, seed=0, count=256)
    with Database.create(tmp_path / "bad.kpred") as database:
        database.add([entry])
    with Database.open(tmp_path / "bad.kpred") as database:
        assert_same(database.entry(name), entry)
        assert database.candidates("chair").structures[0].parts == entry.structure.parts


def test_normals_of_a_box_point_out_of_it():
    item, found = analyse(boxes(np.zeros((1, 3)), np.array([[1.0, 2.0, 0.5]])))
    points = item.points.numpy()
    half = np.array([0.5, 1.0, 0.25])
    side = np.abs(np.abs(points) - half).argmin(axis=1)
    wanted = np.zeros_like(points)
    wanted[np.arange(len(points)), side] = np.sign(points[np.arange(len(points)), side])
    # Points on an edge belong to either side.
    on_edge = (np.sort(np.abs(np.abs(points) - half), axis=1)[:, 1]) < 1e-4
    np.testing.assert_allclose(found.point_normals[~on_edge], wanted[~on_edge], atol=1e-5)
    assert found.structure.parts == 1


def test_winding_does_not_matter(rng):
    mesh = mixed_winding(rng)
    swapped = Mesh(mesh.vertices, mesh.faces[:, ::-1])
    item, found = analyse(mesh)
    points = item.points.numpy()
    other = analyse_surface(item.vertices.numpy(), swapped.faces, points, item.point_faces.numpy())
    np.testing.assert_array_equal(other.point_parts, found.point_parts)
    np.testing.assert_allclose(other.point_normals, found.point_normals, atol=1e-6)


def test_a_stool_is_its_five_boxes(rng):
    item, found = analyse(mixed_winding(rng))
    structure = found.structure
    assert structure.parts == 5
    np.testing.assert_array_equal(np.unique(structure.vertex_parts, return_counts=True)[1], [8] * 5)
    touching = {tuple(pair) for pair in structure.contact_parts}
    assert touching == {(0, part) for part in range(1, 5)}, "the seat is the largest part, and touches its legs"
    assert abs(structure.mirror) < 1e-5
    assert item.frame.scale > 0


def test_structures_are_those_of_the_unit_box(network, assert_same):
    near = boxes(np.array([[0, 0, 0], [0, 1, 0]]), np.array([[1.0, 1, 1], [1, 0.5, 0.5]]))
    far = Mesh(near.vertices * 8 + [64, -32, 16], near.faces)
    one, other = (encode_models([mesh], ["a"], network, seed=0, count=256)[0] for mesh in (near, far))
    assert_same(replace(other, mesh=one.mesh, frame=one.frame, vertex_basis=one.vertex_basis), one)
