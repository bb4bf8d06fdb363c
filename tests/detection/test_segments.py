"""Over-segmentation: smooth pieces, cut where surfaces fold or end."""

import numpy as np

from kpred.detection.segments import _grow, edge_weights, neighbour_edges, segment_voxels
from kpred.preprocessing.normals import estimate_normals


def two_boards() -> np.ndarray:
    """Sample two square boards at right angles on a grid of 2 cm, joined along an edge."""
    x, y = np.meshgrid(np.arange(0, 0.5, 0.02), np.arange(0, 0.5, 0.02))
    level = np.column_stack([x.ravel(), y.ravel(), np.zeros(x.size)])
    upright = np.column_stack([np.full(x.size, 0.5), y.ravel(), x.ravel() + 0.02])
    return np.concatenate([level, upright])


def test_a_fold_parts_two_boards() -> None:
    points = two_boards()
    normals, _ = estimate_normals(points, neighbours=9)
    edges, distance = neighbour_edges(points)
    assert distance.max() < 0.06
    segment = segment_voxels(points, normals, edges)
    half = len(points) // 2
    one, other = np.bincount(segment[:half]), np.bincount(segment[half:])
    assert one.max() > 0.8 * half
    assert other.max() > 0.8 * half
    assert one.argmax() != other.argmax()


def test_smooth_edges_weigh_less_than_folds() -> None:
    points = np.array([[0.0, 0, 0], [1, 0, 0], [1, 0, 1]])
    normals = np.array([[0.0, 0, 1], [0, 0, 1], [1, 0, 0]])
    flat, fold = edge_weights(points, normals, np.array([[0, 1], [1, 2]]))
    assert flat == 0.0
    assert fold > 0.9


def test_compiled_and_plain_code_agree() -> None:
    rng = np.random.default_rng(0)
    edges = np.sort(rng.integers(0, 60, (300, 2)), axis=1)
    weights = np.sort(rng.random(300))
    np.testing.assert_array_equal(_grow(60, edges, weights, 0.3, 4), _grow.py_func(60, edges, weights, 0.3, 4))


def test_every_pair_of_neighbours_comes_once() -> None:
    edges, _ = neighbour_edges(np.random.default_rng(0).random((200, 3)))
    assert (edges[:, 0] < edges[:, 1]).all()
    assert len(np.unique(edges, axis=0)) == len(edges)
    assert neighbour_edges(np.zeros((1, 3)))[0].shape == (0, 2)
