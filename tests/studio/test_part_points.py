"""Points of parts move as the structure map says, and rows are its derivative."""

import numpy as np

from kpred.refinement.structure_fit import StructureMap
from kpred.studio.part_points import affine_solution
from kpred.studio.structure_shape import StructureShape


def test_moved_points_equal_the_map_of_the_fit(table: StructureShape, rng: np.random.Generator) -> None:
    points = table.model.vertices
    solution = 0.02 * rng.standard_normal((3, points.basis.unknowns))
    expected = StructureMap(points.basis, solution)(points.points, points.parts)
    np.testing.assert_allclose(points.moved(solution), expected, atol=1e-6)


def test_an_affine_solution_sizes_and_shifts(table: StructureShape) -> None:
    size, shift = np.array([1.2, 0.7, 1.5]), np.array([0.1, -0.2, 0.3])
    points = table.model.vertices
    moved = points.moved(affine_solution(points.basis, size, shift))
    np.testing.assert_allclose(moved, points.points * size + shift, atol=1e-5)


def test_rows_are_the_derivative_of_the_motion(table: StructureShape, rng: np.random.Generator) -> None:
    points, some = table.model.vertices, np.array([5, 0, 17])
    change = np.zeros_like(table.solution)
    change[:, table.model.free] = 1e-3 * rng.standard_normal((3, len(table.model.free)))
    moved = points.moved(table.solution + change) - points.moved(table.solution)
    for axis in range(3):
        np.testing.assert_allclose(points.rows(axis, some) @ change[axis], moved[some, axis], atol=1e-6)
        np.testing.assert_array_equal(points.rows(axis)[some], points.rows(axis, some))
