"""Parts: what hangs together is one, what is small follows its neighbour, and numbering is by area."""

import numpy as np
import pytest
import trimesh

from kpred.shapes.structure.segmentation import MAX_PARTS, vertex_parts


def union(*boxes):
    """Boxes of (sides, middle), each of 8 vertices."""
    meshes = [trimesh.creation.box(sides) for sides, _ in boxes]
    for mesh, (_, middle) in zip(meshes, boxes, strict=True):
        mesh.apply_translation(middle)
    mesh = trimesh.util.concatenate(meshes)
    return np.asarray(mesh.vertices), np.asarray(mesh.faces)


TABLE = union(
    ((0.05, 0.6, 0.05), (-0.4, -0.3, 0.0)), ((1.0, 0.05, 0.6), (0.0, 0.02, 0.0)), ((0.05, 0.6, 0.05), (0.4, -0.3, 0.0))
)


def test_components_are_parts_the_largest_first():
    np.testing.assert_array_equal(vertex_parts(*TABLE), np.repeat([1, 0, 2], 8))


@pytest.mark.parametrize("size", [1e-3, 1.0, 1e4])
def test_size_and_place_do_not_matter(size):
    vertices, faces = TABLE
    np.testing.assert_array_equal(vertex_parts(vertices * size + 7 * size, faces), vertex_parts(vertices, faces))


def test_the_order_of_vertices_and_faces_does_not_matter(rng):
    vertices, faces = union(
        ((1, 0.1, 0.5), (0, 0, 0)), ((0.1, 0.6, 0.2), (0.4, -0.4, 0)), ((0.3, 0.3, 0.2), (0, 0.3, 0))
    )
    order = rng.permutation(len(vertices))
    shuffled = np.argsort(order)[faces[rng.permutation(len(faces))]]
    np.testing.assert_array_equal(vertex_parts(vertices[order], shuffled), vertex_parts(vertices, faces)[order])


def test_a_screw_belongs_to_the_board_it_lies_in():
    board, other, screw = ((1, 0.1, 0.5), (0, 0, 0)), ((1, 0.1, 0.6), (0, 0.8, 0)), ((0.02, 0.03, 0.02), (0.3, 0.04, 0))
    parts = vertex_parts(*union(board, other, screw))
    assert (parts[16:] == parts[0]).all() and parts[0] != parts[8]


def test_of_two_boxes_around_a_screw_the_smaller_one_has_it():
    parts = vertex_parts(
        *union(((1, 1, 1), (0, 0, 0)), ((0.2, 0.2, 0.2), (0.3, 0, 0)), ((0.02, 0.02, 0.02), (0.3, 0, 0)))
    )
    assert (parts[16:] == parts[8]).all()


@pytest.mark.parametrize("max_parts", [1, 5, MAX_PARTS])
def test_there_are_no_more_parts_than_allowed(max_parts):
    boxes = [((0.2 + 0.001 * k, 0.5, 0.3), (float(k), 0.0, 0.0)) for k in range(24)]
    parts = vertex_parts(*union(*boxes), max_parts)
    assert set(parts) == set(range(min(max_parts, 24)))
    # Each box is of one part, and the largest ones have their own.
    assert all(len(set(parts[8 * k : 8 * k + 8])) == 1 for k in range(24))
    assert parts[-1] == 0


def test_triangles_without_common_vertices_are_welded_by_place():
    vertices, faces = TABLE
    soup, numbers = vertices[faces.reshape(-1)], np.arange(3 * len(faces)).reshape(-1, 3)
    np.testing.assert_array_equal(vertex_parts(soup, numbers), vertex_parts(vertices, faces)[faces.reshape(-1)])


def test_a_vertex_that_no_face_uses_goes_to_the_nearest_part():
    vertices, faces = TABLE
    parts = vertex_parts(np.vstack([vertices, [[0.45, -0.3, 0.1]]]), faces)
    assert parts[-1] == parts[16]


def test_only_tiny_pieces_are_parts_all_the_same():
    places = np.random.default_rng(0).uniform(0, 1, (40, 3))
    vertices, faces = union(*[((0.01, 0.01, 0.01), place) for place in places])
    parts = vertex_parts(vertices, faces)
    assert parts.min() >= 0 and parts.max() < MAX_PARTS
