"""Mirror symmetry: found where it is, with the plane in its place, and not where it is not."""

import numpy as np
import pytest

from kpred.shapes.structure.symmetry import MIN_AREA_RATIO, TOLERANCE, mirror_symmetry

TOP = ((-0.5, 0.4, -0.3), (0.5, 0.45, 0.3))
LEGS = [((x - 0.03, -0.4, z - 0.03), (x + 0.03, 0.4, z + 0.03)) for x in (-0.4, 0.4) for z in (-0.2, 0.2)]


def symmetry(boxes, areas=None):
    corners = np.asarray(boxes, float)
    side = corners[:, 1] - corners[:, 0]
    surface = 2 * (side[:, 0] * side[:, 1] + side[:, 1] * side[:, 2] + side[:, 2] * side[:, 0])
    return mirror_symmetry(corners[:, 0], corners[:, 1], surface if areas is None else np.asarray(areas, float))


def test_of_a_table_the_legs_mirror_each_other():
    plane, partner = symmetry([TOP, *LEGS])
    assert plane == pytest.approx(0.0)
    np.testing.assert_array_equal(partner, [0, 3, 4, 1, 2])


def test_partners_are_mutual(rng):
    boxes = np.asarray([TOP, *LEGS]) + rng.uniform(-0.02, 0.02, (5, 1, 3))
    partner = symmetry(boxes)[1]
    paired = partner >= 0
    np.testing.assert_array_equal(partner[partner[paired]], np.flatnonzero(paired))


@pytest.mark.parametrize("shift", [-3.0, 0.25])
def test_the_plane_moves_with_the_mesh(shift):
    plane, partner = symmetry(np.asarray([TOP, *LEGS]) + [shift, 0, 0])
    assert plane == pytest.approx(shift)
    np.testing.assert_array_equal(partner, symmetry([TOP, *LEGS])[1])


def test_a_mirrored_mesh_has_the_mirrored_plane():
    boxes = np.asarray([TOP, *LEGS]) + [0.2, 0, 0]
    mirrored = np.sort(boxes * [-1.0, 1.0, 1.0], axis=1)
    assert symmetry(mirrored)[0] == pytest.approx(-symmetry(boxes)[0])


def test_the_numbers_of_parts_do_not_matter(rng):
    boxes, order = np.asarray([TOP, *LEGS]), rng.permutation(5)
    partner = symmetry(boxes)[1]
    np.testing.assert_array_equal(order[symmetry(boxes[order])[1]], partner[order])


def test_an_arm_on_one_side_does_not_hide_the_symmetry_of_the_rest():
    """The box of the whole is off the middle then; that of the largest part is not."""
    plane, partner = symmetry([TOP, *LEGS, ((0.5, 0.4, -0.05), (0.7, 0.45, 0.05))])
    assert plane == pytest.approx(0.0)
    np.testing.assert_array_equal(partner, [0, 3, 4, 1, 2, -1])


def test_most_of_the_area_must_have_an_image():
    lopsided = [((-0.5, 0, 0), (0.1, 0.5, 0.5)), ((0.1, 0, 0), (0.5, 0.2, 0.2)), ((-0.5, 0.5, 0), (-0.3, 0.9, 0.1))]
    plane, partner = symmetry(lopsided)
    assert np.isnan(plane)
    np.testing.assert_array_equal(partner, -1)


@pytest.mark.parametrize("off, mirrors", [(0.5 * TOLERANCE, True), (2 * TOLERANCE, False)])
def test_a_part_off_its_mirror_image_is_its_partner_within_the_tolerance(off, mirrors):
    moved = [tuple(np.asarray(corner) + [0, off, 0]) for corner in LEGS[0]]
    partner = symmetry([TOP, moved, *LEGS[1:]])[1]
    assert (partner[1] == 3) == mirrors and partner[0] == 0


def test_parts_of_other_areas_do_not_mirror_each_other():
    areas = np.array([4.0, 0.2, 0.2, 0.2, 0.2])
    assert symmetry([TOP, *LEGS], areas)[1][1] == 3
    areas[1] *= MIN_AREA_RATIO * 0.95
    np.testing.assert_array_equal(symmetry([TOP, *LEGS], areas)[1], [0, -1, 4, -1, 2])


def test_without_area_there_is_none():
    assert np.isnan(symmetry([TOP], [0.0])[0])
