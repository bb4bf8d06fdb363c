"""Contacts: which boxes touch, where, and that distance, not order or numbering, decides."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from kpred.shapes.structure.contacts import TOUCHING, contacts


def boxed(boxes, axes=None, count=400):
    """Axes, boxes, samples of the surfaces and their parts; boxes of (low, high) along each part's own axes."""
    rng = np.random.default_rng(0)
    frames = np.tile(np.eye(3), (len(boxes), 1, 1)) if axes is None else np.asarray(axes)
    points = []
    for (low, high), frame in zip(boxes, frames, strict=True):
        place = rng.uniform(low, high, (count, 3))
        side = rng.integers(0, 3, count)
        lowest, highest = np.asarray(low)[side], np.asarray(high)[side]
        place[np.arange(count), side] = np.where(rng.random(count) < 0.5, lowest, highest)
        points.append(place @ frame)
    parts = np.repeat(np.arange(len(boxes)), count)
    return frames, np.asarray(boxes, float), np.vstack(points), parts


SEAT = ((-0.3, 0.0, -0.3), (0.3, 0.05, 0.3))
LEG = ((0.2, -0.4, 0.2), (0.25, 0.0, 0.25))
BACK = ((-0.3, 0.05, -0.3), (0.3, 0.6, -0.26))


def pairs(found):
    return {tuple(pair) for pair in found[0].tolist()}


def test_what_touches_is_found_and_nothing_else():
    found = contacts(*boxed([SEAT, LEG, BACK]))
    assert pairs(found) == {(0, 1), (0, 2)}
    assert found[0].shape == (4, 2) and found[1].shape == (4, 3)


def test_the_corners_span_the_contact():
    _, corners = contacts(*boxed([SEAT, LEG], count=4000))
    low, high = corners[0], corners[1]
    assert (low <= high).all()
    np.testing.assert_allclose(low[[0, 2]], [0.2, 0.2], atol=0.02)
    np.testing.assert_allclose(high[[0, 2]], [0.25, 0.25], atol=0.02)
    np.testing.assert_allclose([low[1], high[1]], 0.0, atol=TOUCHING)


@pytest.mark.parametrize("gap, touching", [(0.0, True), (0.5 * TOUCHING, True), (1.5 * TOUCHING, False), (0.2, False)])
def test_a_hairline_gap_is_a_contact(gap, touching):
    leg = tuple(tuple(np.array(corner) - [0, gap, 0]) for corner in LEG)
    assert bool(len(contacts(*boxed([SEAT, leg]))[0])) == touching


def test_the_order_of_points_does_not_matter(rng):
    axes, boxes, points, parts = boxed([SEAT, LEG, BACK])
    order = rng.permutation(len(points))
    one, other = contacts(axes, boxes, points, parts), contacts(axes, boxes, points[order], parts[order])
    np.testing.assert_array_equal(one[0], other[0])
    np.testing.assert_allclose(one[1], other[1])


def test_the_numbers_of_parts_do_not_matter():
    straight, reverse = contacts(*boxed([SEAT, LEG, BACK], count=4000)), contacts(*boxed([BACK, LEG, SEAT], count=4000))
    assert pairs(reverse) == {(0, 2), (1, 2)}
    where = {frozenset(2 - p for p in pair): reverse[1][k] for k, pair in enumerate(reverse[0].tolist())}
    for k, pair in enumerate(straight[0].tolist()[1::2]):
        np.testing.assert_allclose(where[frozenset(pair)], straight[1][2 * k + 1], atol=0.03)


def test_shifting_everything_shifts_the_contacts():
    axes, boxes, points, parts = boxed([SEAT, LEG, BACK])
    shift = np.array([1.0, -2.0, 0.5])
    moved = contacts(axes, boxes + shift, points + shift, parts)
    np.testing.assert_allclose(moved[1], contacts(axes, boxes, points, parts)[1] + shift, atol=1e-9)


def test_oblique_parts_whose_boxes_overlap_only_along_the_axes_do_not_touch():
    """Two boards side by side, both at 45 degrees: their boxes along the world's axes overlap, they do not."""
    frame = Rotation.from_euler("z", 45, degrees=True).as_matrix().T
    board = ((-0.4, -0.01, -0.1), (0.4, 0.01, 0.1))
    far = ((-0.4, 0.19, -0.1), (0.4, 0.21, 0.1))
    assert len(contacts(*boxed([board, far], [frame, frame]))[0]) == 0
    assert len(contacts(*boxed([board, ((-0.4, 0.01, -0.1), (0.4, 0.03, 0.1))], [frame, frame]))[0]) == 2


def test_boards_that_cross_touch_without_any_sample_there():
    cross = [((-0.5, -0.01, -0.01), (0.5, 0.01, 0.01)), ((-0.01, -0.5, -0.01), (0.01, 0.5, 0.01))]
    axes, boxes, points, parts = boxed(cross)
    away = np.abs(points).max(axis=1) > 0.1
    assert pairs(contacts(axes, boxes, points[away], parts[away])) <= {(0, 1)}
    assert pairs(contacts(axes, boxes, points, parts)) == {(0, 1)}


@pytest.mark.parametrize("count", [1, 2])
def test_parts_far_apart_have_no_contacts(count):
    boxes = [((k, 0.0, 0.0), (k + 0.1, 0.1, 0.1)) for k in range(count)]
    found = contacts(*boxed(boxes))
    assert found[0].shape == (0, 2) and found[1].shape == (0, 3)
