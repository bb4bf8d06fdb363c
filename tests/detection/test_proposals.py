"""Trees join the likeliest pieces first; what cannot be furniture is no proposal."""

import numpy as np

from kpred.detection.adjacency import Pieces
from kpred.detection.proposals import merge_trees


def pieces_at(boxes: list[tuple[list[float], list[float]]]) -> Pieces:
    """Make pieces of 100 voxels with these lowest and highest corners."""
    low, high = (np.array(corner, dtype=float) for corner in zip(*boxes, strict=True))
    count = len(boxes)
    middle = (low + high) / 2
    return Pieces(
        np.zeros(0, np.int64), np.zeros((count, 1)), np.tile([0.0, 0, 1], (count, 1)), middle, low, high,
        np.full(count, 100),
    )  # fmt: skip


def test_likely_pairs_are_joined_before_unlikely_ones() -> None:
    pieces = pieces_at(
        [([0, 0, 0.1], [0.4, 0.4, 0.5]), ([0, 0, 0.5], [0.4, 0.4, 0.9]), ([0.5, 0, 0.1], [0.9, 0.4, 0.9])]
    )
    pairs = np.array([[0, 1], [1, 2]])
    contact = np.column_stack([np.ones(2), np.full(2, 1.2), np.ones((2, 3))])
    found = merge_trees(pieces, pairs, np.array([2.0, -2.0]), contact)
    assert frozenset({0, 1}) in found
    assert frozenset({1, 2}) not in found
    assert frozenset({0, 1, 2}) in found
    assert len(found) == len(set(found))


def test_what_is_too_low_too_large_or_too_thin_is_left_out() -> None:
    pieces = pieces_at([([0, 0, 0.05], [0.5, 0.5, 0.1]), ([0, 0, 0.1], [6, 0.5, 0.9]), ([0, 0, 0.5], [0.1, 0.1, 0.9])])
    nothing = np.zeros((0, 2), np.int64), np.zeros(0), np.zeros((0, 5))
    assert merge_trees(pieces, *nothing) == []


def test_chairs_are_parted_from_the_table_above_them() -> None:
    seat, top = ([0.0, 0, 0.2], [0.5, 0.5, 0.6]), ([-0.5, -0.5, 0.7], [1, 1, 0.75])
    legs = ([0.2, 0.2, 0.1], [0.3, 0.3, 0.25])
    pairs, contact = np.array([[0, 1], [0, 2]]), np.tile([1.0, 0.3, 0.3, 0.2, 0.1], (2, 1))
    found = merge_trees(pieces_at([seat, top, legs]), pairs, np.array([3.0, -3.0]), contact)
    assert frozenset({0, 2}) in found


def test_doubtful_pairs_are_joined_in_more_than_one_order() -> None:
    boxes = [([0.4 * n, 0, 0.1], [0.4 * n + 0.4, 0.4, 0.9]) for n in range(4)]
    pairs = np.array([[0, 1], [1, 2], [2, 3]])
    contact = np.column_stack([np.ones(3), np.full(3, 1.2), np.ones((3, 3))])
    found = merge_trees(pieces_at(boxes), pairs, np.array([0.1, 0.0, 0.1]), contact)
    assert {frozenset({0, 1}), frozenset({1, 2}), frozenset({2, 3})} <= set(found)
    assert found == merge_trees(pieces_at(boxes), pairs, np.array([0.1, 0.0, 0.1]), contact)
