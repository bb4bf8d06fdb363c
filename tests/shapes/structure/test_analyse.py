"""The structure of whole meshes: consistent, of known furniture known, the same however the mesh is written."""

import numpy as np
import pytest
import torch
import trimesh

from kpred.ops.sampling import sample_surface
from kpred.shapes.structure.analyse import find_structure
from kpred.shapes.structure.segmentation import MAX_PARTS
from kpred.synthetic.assembly import assemble
from kpred.synthetic.generator import FAMILIES, build
from kpred.synthetic.parts import beam, box, cylinder


def analysed(vertices, faces, count=1500):
    generator = torch.Generator().manual_seed(0)
    drawn, on = sample_surface(torch.from_numpy(vertices).float(), torch.from_numpy(faces).long(), count, generator)
    return find_structure(vertices, faces, drawn.numpy().astype(np.float64), on.numpy())


def unit(parts):
    mesh = assemble(parts)
    vertices = mesh.vertices.astype(np.float64)
    low, high = vertices.min(axis=0), vertices.max(axis=0)
    return (vertices - (low + high) / 2) / (high - low).max(), mesh.faces


TABLE = [
    box((1.2, 0.05, 0.8), (0.0, 0.725, 0.0), "top"),
    *[box((0.06, 0.7, 0.06), (x, 0.35, z), "leg") for x in (-0.5, 0.5) for z in (-0.3, 0.3)],
]
SPLAYED = [
    TABLE[0],
    *[beam((1.2 * x, 0, 1.2 * z), (x, 0.7, z), 0.06, 0.06, "leg") for x in (-0.4, 0.4) for z in (-0.2, 0.2)],
]
ROUND = [
    cylinder(0.5, (0.0, 0.7, 0.0), (0.0, 0.74, 0.0), "top", sides=32),
    cylinder(0.06, (0.0, 0.0, 0.0), (0.0, 0.7, 0.0), "column", sides=24),
]


def test_a_table_is_a_top_on_four_legs():
    found = analysed(*unit(TABLE))
    assert found.parts == 5
    np.testing.assert_array_equal(found.axes, np.tile(np.eye(3), (5, 1, 1)))
    assert {tuple(pair) for pair in found.contact_parts.tolist()} == {(0, leg) for leg in range(1, 5)}
    assert found.mirror == pytest.approx(0.0)
    np.testing.assert_array_equal(found.mirrored_parts, [0, 3, 4, 1, 2])
    assert not found.curved.any() and found.ends_only.all() and len(found.affine_ranges) == 0
    assert len(set(found.facets.tolist())) == 30 and found.facets.min() == 0


def test_splayed_legs_have_axes_of_their_own():
    found = analysed(*unit(SPLAYED))
    oblique = (found.axes != np.eye(3)).any(axis=(1, 2))
    np.testing.assert_array_equal(oblique, [False, True, True, True, True])
    assert found.mirror == pytest.approx(0.0)
    # Over all of an oblique part, along every axis, its map is affine.
    assert sorted(found.affine_ranges[:, :2].astype(int).tolist()) == [[p, a] for p in range(1, 5) for a in range(3)]
    legs = found.boxes[1:, 1] - found.boxes[1:, 0]
    np.testing.assert_allclose(np.sort(legs, axis=1)[:, :2], 0.06 / 1.2, rtol=0.1)


def test_a_round_column_is_curved():
    found = analysed(*unit(ROUND))
    np.testing.assert_array_equal(found.curved, [False, True])
    assert (found.facets >= 0).any() and (found.facets < 0).any()


@pytest.mark.parametrize("category", ["chair", "table", "cabinet"])
@pytest.mark.parametrize("number", range(5))
def test_structures_of_generated_furniture_are_consistent(category, number):
    families = list(FAMILIES[category])
    vertices, faces = unit(build(category, families[number * len(families) // 5], number))
    found = analysed(vertices, faces)
    parts, count = found.vertex_parts, found.parts
    assert set(parts.tolist()) == set(range(count)) and count <= MAX_PARTS
    assert (parts[faces] == parts[faces[:, :1]]).all()
    np.testing.assert_allclose(found.axes @ found.axes.transpose(0, 2, 1), np.tile(np.eye(3), (count, 1, 1)), atol=1e-9)
    local = np.einsum("vij,vj->vi", found.axes[parts], vertices)
    assert (local > found.boxes[parts, 0] - 1e-9).all() and (local < found.boxes[parts, 1] + 1e-9).all()
    assert found.contact_parts.shape[0] % 2 == 0
    assert (found.contact_parts[:, 0] < found.contact_parts[:, 1]).all()
    paired = np.flatnonzero(found.mirrored_parts >= 0)
    np.testing.assert_array_equal(found.mirrored_parts[found.mirrored_parts[paired]], paired)
    assert (len(paired) == 0) == bool(np.isnan(found.mirror))
    assert (found.affine_ranges[:, 2] <= found.affine_ranges[:, 3]).all()


def renumbering(one, two):
    """Which part of the second structure each part of the first one is; parts of equal area have no order."""
    number = np.zeros(one.parts, int)
    number[one.vertex_parts] = two.vertex_parts
    np.testing.assert_array_equal(number[one.vertex_parts], two.vertex_parts)
    assert set(number.tolist()) == set(range(two.parts))
    return number


def test_the_order_of_faces_and_their_winding_do_not_matter(rng):
    vertices, faces = unit(SPLAYED)
    order, flipped = rng.permutation(len(faces)), rng.random(len(faces)) < 0.5
    other = np.where(flipped[:, None], faces[order][:, ::-1], faces[order])
    generator = torch.Generator().manual_seed(0)
    drawn, on = sample_surface(torch.from_numpy(vertices).float(), torch.from_numpy(faces).long(), 1500, generator)
    points = drawn.numpy().astype(np.float64)
    one = find_structure(vertices, faces, points, on.numpy())
    two = find_structure(vertices, other, points, np.argsort(order)[on.numpy()])
    number = renumbering(one, two)
    np.testing.assert_allclose(one.boxes, two.boxes[number], atol=1e-6)
    np.testing.assert_allclose(one.axes, two.axes[number], atol=1e-6)
    pairs = [{frozenset(pair) for pair in found.tolist()} for found in (number[one.contact_parts], two.contact_parts)]
    assert pairs[0] == pairs[1] and len(pairs[0]) == 4
    np.testing.assert_array_equal(number[one.mirrored_parts], two.mirrored_parts[number])
    # Facets are numbered by appearance, and the same faces are together.
    together = one.facets[order][:, None] == one.facets[order][None]
    np.testing.assert_array_equal(together, two.facets[:, None] == two.facets[None])


def test_the_mirror_image_has_the_same_structure():
    vertices, faces = unit(SPLAYED)
    one, two = analysed(vertices, faces), analysed(vertices * [-1.0, 1.0, 1.0], faces[:, ::-1].copy())
    assert two.mirror == pytest.approx(-one.mirror, abs=1e-9)
    number = renumbering(one, two)
    np.testing.assert_array_equal(number[one.mirrored_parts], two.mirrored_parts[number])


@pytest.mark.parametrize("count", [1, 12])
def test_triangles_without_area_belong_to_no_facet(count):
    mesh = trimesh.creation.box((1.0, 0.5, 0.4))
    vertices = np.asarray(mesh.vertices)
    faces = np.vstack([mesh.faces, np.zeros((count, 3), int)])
    found = analysed(vertices, faces)
    assert found.parts == 1 and (found.facets[-count:] == -1).all() and not found.curved[0]


def test_a_single_triangle_has_a_structure():
    vertices = np.array([[0.0, 0, 0], [1.0, 0, 0], [0.0, 0.5, 0.5]])
    found = analysed(vertices, np.array([[0, 1, 2]]), count=20)
    assert found.parts == 1 and np.isfinite(found.boxes).all() and len(found.contact_parts) == 0
