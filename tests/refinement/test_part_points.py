"""Points of parts follow affine maps, in any order, and their rows are the derivative of the motion."""

import numpy as np
import pytest

from kpred.refinement.part_points import PartPoints, affine_solution

SIZE, SHIFT = np.array([1.2, 0.7, 1.5]), np.array([0.1, -0.2, 0.3])


def vertices(case):
    return PartPoints(case.model.basis, case.vertices, case.structure.vertex_parts)


@pytest.mark.parametrize("name", ["chair", "table"])
def test_an_affine_solution_sizes_and_shifts(cases, name):
    points = vertices(cases[name])
    moved = points.moved(affine_solution(points.basis, SIZE, SHIFT))
    np.testing.assert_allclose(moved, points.points * SIZE + SHIFT, atol=1e-5)


def test_the_order_of_points_does_not_matter(case, rng):
    points = vertices(case)
    solution = 0.02 * rng.standard_normal((3, points.basis.unknowns))
    order = rng.permutation(len(points.points))
    other = PartPoints(points.basis, points.points[order], points.parts[order])
    np.testing.assert_allclose(other.moved(solution), points.moved(solution)[order], atol=1e-5)


def test_rows_are_the_derivative_of_the_motion(cases, rng):
    points, some = vertices(cases["table"]), np.array([5, 0, 17])
    solution = affine_solution(points.basis, SIZE, SHIFT)
    change = 1e-3 * rng.standard_normal(solution.shape)
    # Leans become rotations, and bends come after them: of both the motion is not linear.
    change[:, points.basis.controls + 2 :: 4] = change[:, points.basis.controls + 3 :: 4] = 0.0
    moved = points.moved(solution + change) - points.moved(solution)
    for axis in range(3):
        np.testing.assert_allclose(points.rows(axis, some) @ change[axis], moved[some, axis], atol=1e-6)
