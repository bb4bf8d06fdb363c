"""Affine ranges: exactly where a facet is oblique; there any separable map that is affine in them keeps it planar."""

import numpy as np
import pytest
import trimesh

from kpred.shapes.structure.affine_ranges import affine_ranges, ends_only


def ranges_of(mesh):
    corners = np.asarray(mesh.triangles)
    return affine_ranges(np.asarray(mesh.face_normals), corners.min(axis=1), corners.max(axis=1))


def wedge(place=(0.0, 0.0, 0.0)):
    """A prism along x whose one side slopes over y and z from 0 to 1."""
    triangle = np.array([[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]])
    vertices = np.array([[x, y, z] for x in (0.0, 1.0) for y, z in triangle]) + place
    return trimesh.convex.convex_hull(vertices)


def test_boxes_have_none():
    assert ranges_of(trimesh.creation.box((1.0, 0.4, 0.3))) == []


def test_a_slope_is_a_range_along_both_of_its_axes():
    assert ranges_of(wedge()) == [(1, 0.0, 1.0), (2, 0.0, 1.0)]
    np.testing.assert_allclose(ranges_of(wedge((5.0, 2.0, -3.0))), [(1, 2.0, 3.0), (2, -3.0, -2.0)])


def test_slopes_far_apart_are_two_ranges_and_touching_ones_are_one():
    two = trimesh.util.concatenate([wedge(), wedge((0.0, 2.0, 0.0))])
    assert [found[1:] for found in ranges_of(two) if found[0] == 1] == [(0.0, 1.0), (2.0, 3.0)]
    one = trimesh.util.concatenate([wedge(), wedge((0.0, 0.995, 0.0))])
    assert [found[1:] for found in ranges_of(one) if found[0] == 1] == [(0.0, pytest.approx(1.995))]


def test_ranges_along_an_axis_are_disjoint_and_hold_every_oblique_face(rng):
    mesh = trimesh.convex.convex_hull(rng.normal(size=(30, 3)))
    corners, found = np.asarray(mesh.triangles), ranges_of(mesh)
    for axis in range(3):
        mine = sorted(one[1:] for one in found if one[0] == axis)
        assert all(before[1] < after[0] for before, after in zip(mine, mine[1:]))
        for low, high in zip(corners.min(axis=1)[:, axis], corners.max(axis=1)[:, axis]):
            assert any(first <= low and high <= last for first, last in mine)


def test_a_map_that_is_affine_within_them_keeps_planes(rng):
    """A bar with a bevel at each end: between the bevels any map will do."""
    outline = np.array([[0.0, 0.0], [0.2, 0.3], [0.8, 0.3], [1.0, 0.0]])
    vertices = np.array([[x, y, z] for z in (0.0, 0.4) for x, y in outline])
    mesh = trimesh.convex.convex_hull(vertices)
    along = [found[1:] for found in ranges_of(mesh) if found[0] == 0]
    np.testing.assert_allclose(along, [(0.0, 0.2), (0.8, 1.0)])
    moved = np.asarray(mesh.vertices).copy()
    moved[:, 0] = np.interp(moved[:, 0], [0.0, 0.2, 0.8, 1.0], [0.0, 0.7, 1.0, 3.0])
    for facet in mesh.facets:
        used = moved[np.unique(np.asarray(mesh.faces)[facet])]
        assert np.linalg.svd(used - used.mean(axis=0))[1][2] < 1e-9


@pytest.mark.parametrize("degrees, oblique", [(1.0, False), (2.0, True)])
def test_what_is_nearly_along_the_axes_is_so(degrees, oblique):
    mesh = trimesh.creation.box((1.0, 0.4, 0.3))
    mesh.apply_transform(trimesh.transformations.rotation_matrix(np.radians(degrees), (0, 0, 1)))
    assert bool(ranges_of(mesh)) == oblique


def test_boards_have_vertices_at_their_ends_alone():
    box = trimesh.creation.box((1.0, 0.4, 0.3))
    np.testing.assert_array_equal(ends_only(np.asarray(box.vertices)), [True, True, True])
    np.testing.assert_array_equal(ends_only(np.asarray(box.subdivide().vertices)), [False, False, False])
    inside = np.vstack([box.vertices, [[0.1, 0.2, 0.15]]])
    np.testing.assert_array_equal(ends_only(inside), [False, True, True])


def test_a_single_vertex_has_only_ends():
    np.testing.assert_array_equal(ends_only(np.zeros((1, 3))), [True, True, True])
