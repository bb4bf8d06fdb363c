"""Pieces that touch are found, and described without regard to where in the room they lie."""

import numpy as np

from kpred.detection.adjacency import PAIR_FEATURES, describe_pieces, pair_features, touching


def three_blocks() -> tuple[np.ndarray, np.ndarray]:
    """Sample two blocks side by side and one 30 cm away, on a grid of 2 cm; points and pieces."""
    x, y, z = (axis.ravel() for axis in np.meshgrid(*[np.arange(count) * 0.02 for count in (10, 6, 3)]))
    block = np.column_stack([x, y, z])
    points = np.concatenate([block, block + [0.22, 0, 0], block + [0.7, 0, 0]])
    return points, np.repeat([0, 1, 2], len(block))


def test_only_near_pieces_touch() -> None:
    points, segment = three_blocks()
    pieces = describe_pieces(points, np.tile([0.0, 0, 1], (len(points), 1)), segment, np.zeros((0, 3)), 0.02)
    pairs, contact = touching(points, pieces)
    assert pairs.tolist() == [[0, 1]]
    assert 0 < contact[0, 1] <= 1
    assert pair_features(pieces, pairs, contact).shape == (1, PAIR_FEATURES)
    np.testing.assert_allclose(pieces.high - pieces.low, [[0.18, 0.10, 0.04]] * 3)
    assert pieces.sizes.tolist() == [180, 180, 180]


def test_features_do_not_depend_on_the_place_in_plan() -> None:
    points, segment = three_blocks()
    normals = np.tile([0.0, 0, 1], (len(points), 1))
    found = []
    for offset in ([0, 0, 0], [4.0, -8.0, 0]):
        moved = points + offset
        pieces = describe_pieces(moved, normals, segment, np.zeros((0, 3)), 0.02)
        pairs = np.array([[0, 1], [1, 2]])
        found.append(pair_features(pieces, pairs, np.zeros((2, 5))))
    np.testing.assert_allclose(found[0], found[1], atol=1e-6)


def test_what_touches_a_wall_is_near_the_structure() -> None:
    points, segment = three_blocks()
    wall = points[segment == 0] - [0.22, 0, 0]
    pieces = describe_pieces(points, np.tile([0.0, 0, 1], (len(points), 1)), segment, wall, 0.02)
    assert pieces.features[0, -2] < 0.05
    assert pieces.features[2, -2] == 0.3
