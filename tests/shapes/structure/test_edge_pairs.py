"""Pairs of faces at edges: all of them in small groups, linear in large ones, whatever the winding."""

from __future__ import annotations

import numpy as np
import pytest

from kpred.shapes.structure.edge_pairs import (
    angles_between,
    direction_keys,
    edge_numbers,
    face_frames,
    line_angles,
    pairs_in_groups,
)


def test_small_groups_give_all_pairs_once_and_negative_groups_none(rng: np.random.Generator) -> None:
    groups = np.concatenate([np.repeat(np.arange(10), [1, 2, 3, 4, 4, 3, 2, 1, 4, 2]), [-1, -1, -2]])
    groups = rng.permutation(groups)
    first, second = pairs_in_groups(groups, rng.random(len(groups)), 3)
    found = sorted(tuple(sorted(pair)) for pair in zip(first.tolist(), second.tolist()))
    n = len(groups)
    assert found == [(i, j) for i in range(n) for j in range(i + 1, n) if groups[i] == groups[j] >= 0]


def test_large_groups_give_a_linear_number_of_pairs_that_chain_equal_keys(rng: np.random.Generator) -> None:
    keys = rng.integers(0, 5, 1000).astype(float)
    first, second = pairs_in_groups(np.zeros(1000, np.int64), keys, 3)
    assert len(first) < 3000
    equal = keys[first] == keys[second]
    assert equal.sum() >= 3 * (1000 - 5 * 3)


def test_edges_are_numbered_by_their_ends_in_either_order() -> None:
    numbers = edge_numbers(np.array([[0, 1, 2], [2, 1, 3], [4, 4, 5]]))
    assert numbers[1] == numbers[3] and numbers[6] == -1 and numbers[7] == numbers[8]
    assert len(set(numbers.tolist())) == 7


def test_directions_into_faces_do_not_depend_on_winding(rng: np.random.Generator) -> None:
    vertices, faces = rng.random((30, 3)), np.arange(30).reshape(10, 3)
    frames, reversed_frames = face_frames(vertices, faces, 0.0), face_frames(vertices, faces[:, ::-1], 0.0)
    assert reversed_frames.normals == pytest.approx(-frames.normals)
    # Half-edges 0, 1, 2 of corners a, b, c are half-edges 1, 0, 2 of corners c, b, a.
    inward = frames.inward.reshape(-1, 3, 3)
    assert reversed_frames.inward.reshape(-1, 3, 3)[:, [1, 0, 2]] == pytest.approx(inward)
    corners = vertices[faces]
    assert (np.einsum("fki,fki->fk", inward, corners[:, [2, 0, 1]] - corners) > 0).all()
    assert np.abs(np.einsum("fki,fki->fk", inward, corners[:, [1, 2, 0]] - corners)).max() < 1e-12


def test_angles_are_exact_when_small_and_keys_do_not_see_signs(rng: np.random.Generator) -> None:
    angles = np.array([0.0, 1e-9, 1e-4, 10.0, 90.0, 170.0, 180.0])
    other = np.column_stack([np.cos(np.radians(angles)), np.sin(np.radians(angles)), np.zeros(7)])
    axis = np.tile([1.0, 0.0, 0.0], (7, 1))
    assert angles_between(axis, other) == pytest.approx(angles, rel=1e-9)
    assert line_angles(axis, other) == pytest.approx([0, 1e-9, 1e-4, 10, 90, 10, 0], rel=1e-9, abs=1e-12)
    directions = rng.normal(size=(20, 3))
    assert (direction_keys(directions) == direction_keys(-directions)).all()
