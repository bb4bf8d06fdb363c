"""Own axes: of a rotated box they are its sides, named by the world's axes that they are near to."""

import numpy as np
import pytest
import trimesh
from scipy.spatial.transform import Rotation

from kpred.shapes.structure.own_axes import own_axes

SMALL = [("x", 5.0), ("y", 20.0), ("z", 40.0), ("xy", (10.0, 15.0)), ("xyz", (8.0, -12.0, 20.0))]


def axes_of(mesh, planar=True):
    areas = np.asarray(mesh.area_faces)
    flat = np.full(len(areas), float(planar))
    return own_axes(np.asarray(mesh.face_normals), areas, flat, np.asarray(mesh.vertices))


def rotated(mesh, rotation):
    copy = mesh.copy()
    copy.vertices = rotation.apply(copy.vertices)
    return copy


@pytest.mark.parametrize("order, angles", SMALL)
def test_of_a_rotated_box_they_are_its_sides(order, angles):
    rotation = Rotation.from_euler(order, angles, degrees=True)
    found = axes_of(rotated(trimesh.creation.box((1.0, 0.6, 0.3)), rotation))
    # Rows are where x, y and z go, as long as each stays the nearest one.
    np.testing.assert_allclose(found, rotation.as_matrix().T, atol=1e-6)


@pytest.mark.parametrize("planar", [True, False])
def test_they_are_a_right_handed_frame(rng, planar):
    for _ in range(20):
        sides = rng.uniform(0.05, 1, 3)
        mesh = rotated(trimesh.creation.box(sides), Rotation.random(random_state=int(rng.integers(1000))))
        found = axes_of(mesh, planar)
        np.testing.assert_allclose(found @ found.T, np.eye(3), atol=1e-9)
        assert np.linalg.det(found) > 0


def test_what_lies_along_the_axes_has_exactly_those():
    for degrees in (0.0, 0.5):
        mesh = rotated(trimesh.creation.box((1.0, 0.6, 0.3)), Rotation.from_euler("y", degrees, degrees=True))
        np.testing.assert_array_equal(axes_of(mesh), np.eye(3))
    np.testing.assert_array_equal(axes_of(trimesh.creation.icosphere(), planar=False), np.eye(3))


def test_winding_does_not_matter(rng):
    mesh = rotated(trimesh.creation.box((1.0, 0.6, 0.3)), Rotation.from_euler("xyz", (8, 10, 30), degrees=True))
    sign = np.where(rng.random(len(mesh.faces)) < 0.5, -1.0, 1.0)
    areas, vertices = np.asarray(mesh.area_faces), np.asarray(mesh.vertices)
    found = own_axes(sign[:, None] * mesh.face_normals, areas, np.ones(len(areas)), vertices)
    np.testing.assert_allclose(found, axes_of(mesh), atol=1e-9)


@pytest.mark.parametrize("degrees", [10.0, 30.0])
def test_of_a_round_bar_one_is_its_direction(degrees):
    bar = trimesh.creation.cylinder(0.03, 0.8, sections=24)
    bar.apply_transform(trimesh.transformations.rotation_matrix(-np.pi / 2, (1, 0, 0)))
    rotation = Rotation.from_euler("z", degrees, degrees=True)
    found = axes_of(rotated(bar, rotation), planar=False)
    assert abs(found[1] @ rotation.apply([0, 1, 0])) > np.cos(np.radians(0.5))


def test_a_part_without_area_has_those_of_the_world():
    np.testing.assert_array_equal(own_axes(np.zeros((0, 3)), np.zeros(0), np.zeros(0), np.zeros((1, 3))), np.eye(3))
    np.testing.assert_array_equal(own_axes(np.zeros((2, 3)), np.zeros(2), np.zeros(2), np.zeros((3, 3))), np.eye(3))


def test_a_single_oblique_sheet_has_its_normal_among_them():
    normal = np.array([0.0, np.cos(0.4), np.sin(0.4)])
    corners = np.array([[0, 0, 0], [1, 0, 0], [1, -np.sin(0.4), np.cos(0.4)], [0, -np.sin(0.4), np.cos(0.4)]])
    found = own_axes(np.stack([normal, normal]), np.full(2, 0.5), np.ones(2), corners)
    np.testing.assert_allclose(np.abs(found @ normal).max(), 1.0, atol=1e-9)
