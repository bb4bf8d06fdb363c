"""Which parts repeat: equal sides, alike curved; and which of their sides are thicknesses."""

import numpy as np

from kpred.shapes.structure.repeats import repeated_parts, repeated_thicknesses

SIDES = np.array([[0.05, 0.7, 0.05], [1.0, 0.03, 0.6], [0.05, 0.703, 0.05], [0.05, 0.7, 0.06], [0.05, 0.7, 0.05]])
STRAIGHT = np.zeros(5, bool)


def test_parts_of_equal_sides_are_one_set():
    assert repeated_parts(SIDES, STRAIGHT, 1.0).tolist() == [0, 1, 0, 2, 0]


def test_a_curved_part_repeats_no_straight_one():
    assert repeated_parts(SIDES, np.arange(5) == 4, 1.0).tolist() == [0, 1, 0, 2, 3]


def test_sets_do_not_depend_on_the_unit():
    sets = repeated_parts(SIDES, STRAIGHT, 1.0)
    np.testing.assert_array_equal(repeated_parts(1000 * SIDES, STRAIGHT, 1000.0), sets)


def test_thicknesses_are_short_sides_of_parts_that_another_repeats():
    sets = repeated_parts(SIDES, STRAIGHT, 1.0)
    thin = repeated_thicknesses(SIDES, sets, 1.0)
    leg = [True, False, True]
    assert thin.tolist() == [leg, [False] * 3, leg, [False] * 3, leg]


def test_no_parts_are_no_sets():
    empty = np.zeros((0, 3))
    assert len(repeated_parts(empty, np.zeros(0, bool), 1.0)) == 0
