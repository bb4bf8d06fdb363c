"""Seen surface: cells of other things, and cells above a seen floor, deep inside of solids."""

import numpy as np

from kpred.fitting.seen_surface import ABOVE_FLOOR, SeenSurface, deep_cells, owners
from kpred.ops.solid_cells import CELL


def block(width: int) -> np.ndarray:
    axis = np.arange(width)
    return np.stack(np.meshgrid(axis, axis, axis, indexing="ij"), axis=-1).reshape(-1, 3)


def test_deep_cells_are_two_cells_from_the_surface() -> None:
    deep = deep_cells(block(7))
    assert deep.min() == 2 and deep.max() == 4
    assert len(deep) == 27
    assert len(deep_cells(block(4))) == 0  # A board has no inside.


def test_surface_of_others_is_seen_and_own_surface_is_not() -> None:
    points = np.array([[0.1, 0.5, 0.1], [0.101, 0.5, 0.1], [0.3, 0.5, 0.1], [np.nan, 0.0, 0.0]])
    seen = SeenSurface(points, np.array([0, 1, 1, -1]), None)
    box = np.array([[0.0, 0.0, 0.0], [1.0, 1.0, 1.0]])
    assert len(seen.around(0, box, 0.0)) == 1  # One cell holds both.
    assert len(seen.around(1, box, 0.0)) == 0
    assert len(seen.around(2, box, 0.0)) == 2
    assert len(seen.around(2, box - 2.0, 0.1)) == 0


def test_a_seen_floor_is_empty_above() -> None:
    points = np.array([[0.11, -0.01, 0.11], [0.11, 0.5, 0.11]])
    cells = SeenSurface(points, np.array([-1, -1]), 0.0).around(0, np.array([[0.0, 0.0, 0.0], [1.0, 1.0, 1.0]]), 0.1)
    heights = sorted(cells[:, 1].tolist())
    assert heights == [*ABOVE_FLOOR, int(0.5 / CELL)]


def test_rows_are_numbered_by_their_object() -> None:
    assert owners(5, [np.array([1, 2]), np.array([4, -1])]).tolist() == [-1, 0, 0, -1, 1]
