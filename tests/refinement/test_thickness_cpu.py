"""The compiled stiffness of boards against the same sums in numpy."""

from __future__ import annotations

import numpy as np
import pytest

from kpred.refinement.thickness_cpu import FACING, MIN_HELD, hold_thickness


def plain(
    normals: np.ndarray,
    parts: np.ndarray,
    seen: np.ndarray,
    half: np.ndarray,
    thin: float,
    blurred: float,
    growth: np.ndarray,
) -> np.ndarray:
    """The same quadratic form, by sums over all parts at once."""
    found = np.zeros((3, growth.shape[2], growth.shape[2]))
    for axis in range(3):
        sides = []
        for sign in (-1.0, 1.0):
            facing = (sign * normals[:, axis] > FACING).astype(np.float64)
            total = np.bincount(parts, facing, len(half))
            sides.append(np.bincount(parts, facing * seen, len(half)) / np.maximum(total, 1e-9))
        held = np.maximum(1.0 - np.minimum(*sides), np.clip(2.0 - 2 * half[:, axis] / max(blurred, 1e-9), 0.0, 1.0))
        rows = (2 * half[:, axis] < thin) & (held > MIN_HELD)
        chosen = growth[rows, axis]
        found[axis] = chosen.T @ (held[rows][:, None] * chosen)
    return found


@pytest.mark.parametrize("blurred", [0.0, 0.1])
def test_the_compiled_form_is_the_plain_one(blurred: float) -> None:
    rng = np.random.default_rng(0)
    parts = np.sort(rng.integers(0, 6, 400))
    parts[parts == 3] = 4  # one part has no points
    normals = rng.normal(size=(400, 3))
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    seen, half = rng.uniform(0.5, 1.0, 400), rng.uniform(0.01, 0.12, (6, 3))
    growth = rng.normal(size=(6, 3, 9)) * (rng.random((6, 3, 9)) < 0.4)
    stiff = np.ones((3, 9, 9))
    bounds = np.searchsorted(parts, np.arange(7))
    hold_thickness(normals, bounds, seen, half, 0.15, blurred, growth, 2.0, stiff)
    expected = 1.0 + 2.0 * plain(normals, parts, seen, half, 0.15, blurred, growth)
    np.testing.assert_allclose(stiff, expected, atol=1e-9)
    assert not np.allclose(expected, 1.0)


def test_boards_seen_from_both_sides_are_free() -> None:
    normals = np.repeat(np.concatenate([np.eye(3), -np.eye(3)]), 5, axis=0)
    stiff = np.zeros((3, 4, 4))
    hold_thickness(
        normals, np.array([0, 30]), np.ones(30), np.full((1, 3), 0.02), 0.15, 0.0, np.ones((1, 3, 4)), 1.0, stiff
    )
    assert not stiff.any()
