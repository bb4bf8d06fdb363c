"""Placing an undeformed model: what was done to a copy is found, and nothing else is done."""

import numpy as np
import pytest

from kpred.refinement.placement import Placement, fit_placement

SEEN = np.ones(2048)


def place(case, goal, rounds=40, **options):
    points = case.points.astype(np.float32)
    chosen = {"per_axis": False, "free_yaw": True} | options
    return fit_placement(
        points, Placement.identity(), np.ascontiguousarray(goal, np.float32), SEEN, rounds=rounds, **chosen
    )


def test_the_matrix_is_the_map(case):
    placed = Placement(0.4, np.array([1.1, 0.9, 1.3]), np.array([0.1, -0.2, 0.3]))
    moved = np.column_stack([case.points, np.ones(len(case.points))]) @ placed.matrix().T
    np.testing.assert_allclose(placed(case.points), moved[:, :3], atol=1e-12)
    np.testing.assert_array_equal(Placement.identity()(case.points), case.points)


def test_a_positive_yaw_brings_the_front_to_the_right():
    np.testing.assert_allclose(
        Placement(np.pi / 2, np.ones(3), np.zeros(3))(np.array([[0.0, 0, 1]])), [[1, 0, 0]], atol=1e-9
    )


@pytest.mark.parametrize("name", ["chair", "splayed chair", "shelf", "curved chair"])
@pytest.mark.parametrize("yaw", [-0.15, 0.1])
def test_yaw_size_and_shift_of_a_copy_are_found(cases, name, yaw):
    case = cases[name]
    true = Placement(yaw, np.full(3, 1.15), np.array([0.05, -0.03, 0.02]))
    found = place(case, true(case.scan(case.vertices)))
    assert abs(found.yaw - yaw) < 0.02
    np.testing.assert_allclose(found.size, true.size, atol=0.02)
    np.testing.assert_allclose(found.shift, true.shift, atol=0.01)


@pytest.mark.parametrize("name", ["table", "chair", "splayed chair", "curved chair"])
def test_a_size_per_axis_is_found(cases, name):
    case = cases[name]
    true = Placement(0.0, np.array([1.15, 0.9, 1.05]), np.array([0.03, 0.02, -0.04]))
    found = place(case, true(case.scan(case.vertices)), per_axis=True, free_yaw=False)
    np.testing.assert_allclose(found.size, true.size, rtol=0.025)
    np.testing.assert_allclose(found.shift, true.shift, atol=0.01)
    assert abs(found.yaw) < 1e-4


def test_its_own_points_leave_it_in_place(case):
    found = place(case, case.points, rounds=6)
    np.testing.assert_allclose(found(case.points), case.points, atol=1e-5)


def test_one_size_is_one_size(case):
    found = place(case, case.scan(case.vertices * [1.2, 0.9, 1.0]))
    np.testing.assert_allclose(found.size, found.size[0])
    assert abs(found.size[0] - 1) > 0.002


def test_what_is_not_free_stays(case):
    goal = Placement(0.1, np.full(3, 1.05), np.full(3, 0.05))(case.scan(case.vertices))
    found = place(case, goal, free_yaw=False, free_size=False)
    assert abs(found.yaw) < 1e-5
    np.testing.assert_allclose(found.size, 1.0, atol=1e-5)
    np.testing.assert_allclose(found.shift, 0.05, atol=0.02)


def test_a_round_model_has_no_yaw(cases):
    turned = Placement(0.1, np.ones(3), np.zeros(3))
    goal = turned(cases["round table"].scan(cases["round table"].vertices)).astype(np.float32)
    disc = cases["round table"]
    kept = disc.points[:, 1] > disc.points[:, 1].max() - 0.05
    found = fit_placement(
        disc.points[kept].astype(np.float32), Placement.identity(), goal[goal[:, 1] > goal[:, 1].max() - 0.05],
        np.ones(kept.sum()), per_axis=False, free_yaw=True,
    )  # fmt: skip
    assert abs(found.yaw) < 0.03


def test_unseen_surface_is_held_where_it_is_expected(cases):
    """Half of a table is seen, the other half is expected farther out."""
    case = cases["table"]
    right = case.points[:, 0] > 0
    expected = case.points * np.where(right, 1.0, 1.3)[:, None] ** [1, 0, 0]
    goal = np.ascontiguousarray(case.scan(case.vertices))
    goal = goal[goal[:, 0] > 0]
    points, visible = case.points.astype(np.float32), right.astype(float)
    options = {"per_axis": True, "free_yaw": False, "rounds": 20}
    plain = fit_placement(points, Placement.identity(), goal, visible, **options)
    held = fit_placement(points, Placement.identity(), goal, visible, expected=expected, **options)
    assert held(case.points)[:, 0].min() < plain(case.points)[:, 0].min() - 0.02
    assert abs(held(case.points)[:, 0].max() - 0.5) < 0.05


def test_the_default_rounds_are_enough(cases):
    case = cases["round table"]
    true = Placement(0.0, np.array([1.2, 0.9, 1.0]), np.zeros(3))
    found = place(case, true(case.scan(case.vertices)), per_axis=True, free_yaw=False)
    np.testing.assert_allclose(found.size, true.size, rtol=0.03)


@pytest.mark.parametrize("points", [1, 7, 9])
def test_few_points_give_a_finite_place(cases, points, rng):
    case = cases["chair"]
    for per_axis in (False, True):
        few = rng.normal(size=(points, 3)).astype(np.float32)
        found = fit_placement(
            case.points[:points].astype(np.float32), Placement.identity(), few, np.ones(points), per_axis=per_axis,
            free_yaw=True,
        )  # fmt: skip
        assert np.isfinite(found.matrix()).all()
        assert (found.size > 0).all()
