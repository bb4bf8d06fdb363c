"""Trilinear interpolation: exact for functions linear in each axis and at the nodes, constant beyond the box."""

import numpy as np
import pytest

from kpred.ops.trilinear import interpolate_grid

LOW, HIGH = np.array([-1.0, 0.5, 2.0]), np.array([3.0, 1.5, 2.5])


def _nodes(shape: tuple[int, int, int]) -> np.ndarray:
    axes = [np.linspace(low, high, count) for low, high, count in zip(LOW, HIGH, shape, strict=True)]
    return np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1)


def _linear(places: np.ndarray) -> np.ndarray:
    return places @ np.array([0.3, -2.0, 1.1]) + 0.7


def test_linear_functions_are_reproduced(rng: np.random.Generator) -> None:
    grid = _linear(_nodes((5, 3, 4))).astype(np.float32)
    places = LOW + (HIGH - LOW) * rng.random((200, 3))
    np.testing.assert_allclose(interpolate_grid(grid, LOW, HIGH, places), _linear(places), atol=1e-5)


def test_values_at_nodes_are_those_of_the_grid(rng: np.random.Generator) -> None:
    grid = rng.random((4, 2, 6)).astype(np.float32)
    found = interpolate_grid(grid, LOW, HIGH, _nodes(grid.shape).reshape(-1, 3))
    np.testing.assert_allclose(found, grid.ravel(), atol=1e-5)


def test_places_outside_have_the_value_of_the_nearest_place_of_the_box(rng: np.random.Generator) -> None:
    grid = rng.random((3, 3, 3)).astype(np.float32)
    places = LOW + (HIGH - LOW) * (6 * rng.random((100, 3)) - 3)
    inside = interpolate_grid(grid, LOW, HIGH, places.clip(LOW, HIGH))
    np.testing.assert_allclose(interpolate_grid(grid, LOW, HIGH, places), inside, atol=1e-6)
    assert grid.min() <= inside.min() and inside.max() <= grid.max()


def test_a_flat_box_and_no_places_have_finite_values(rng: np.random.Generator) -> None:
    grid = rng.random((3, 3, 3)).astype(np.float32)
    flat = interpolate_grid(grid, LOW, np.array([3.0, 0.5, 2.5]), np.array([[3.0, 0.5, 2.5], [3.0, 9.0, 2.5]]))
    np.testing.assert_allclose(flat, grid[2, 0, 2], atol=1e-6)
    assert interpolate_grid(grid, LOW, HIGH, np.zeros((0, 3))).shape == (0,)


def test_a_grid_of_one_node_is_refused() -> None:
    with pytest.raises(ValueError, match="two nodes"):
        interpolate_grid(np.zeros((1, 3, 3), np.float32), LOW, HIGH, np.zeros((2, 3)))
