"""Where the parts of a mesh touch."""

from __future__ import annotations

import numpy as np

from kpred.ops.typing import Float, Int

TOUCHING = 0.015
"""Parts that come so near to each other touch, unit box: models leave hairline gaps."""

_NEAR = 0.05
"""Samples of a surface are about so far apart, unit box."""


def contacts(
    axes: Float[np.ndarray, "parts 3 3"],
    boxes: Float[np.ndarray, "parts 2 3"],
    points: Float[np.ndarray, "points 3"],
    point_parts: Int[np.ndarray, " points"],
) -> tuple[Int[np.ndarray, "contacts 2"], Float[np.ndarray, "contacts 3"]]:
    """Find pairs of parts that touch, and two opposite corners of the box in which they do; unit box.

    Args:
        axes, boxes: of each part's own box.
        points: vertices and surface samples of all parts; point_parts: part of each.

    Returns:
        parts (2 x pairs, 2) and points (2 x pairs, 3): rows 2k and 2k + 1 are the corners of pair k.
    """
    low, high = _world_boxes(axes, boxes)
    members = [points[point_parts == part] for part in range(len(axes))]
    reach_low, reach_high = low - TOUCHING / 2, high + TOUCHING / 2
    near = (reach_low[:, None] <= reach_high[None]).all(2) & (reach_low[None] <= reach_high[:, None]).all(2)
    pairs, corners = [], []
    for first, second in zip(*np.nonzero(np.triu(near, 1))):
        shared = np.stack([np.maximum(low[first], low[second]), np.minimum(high[first], high[second])])
        middle, half = shared.mean(axis=0), np.abs(shared[1] - shared[0]) / 2
        found = _shared_box(axes, boxes, members, int(first), int(second), middle, half)
        if found is not None:
            pairs += [(first, second)] * 2
            corners += list(found)
    return np.array(pairs, dtype=np.int32).reshape(-1, 2), np.array(corners, dtype=np.float64).reshape(-1, 3)


def _shared_box(
    axes: np.ndarray,
    boxes: np.ndarray,
    members: list[np.ndarray],
    first: int,
    second: int,
    middle: np.ndarray,
    half: np.ndarray,
) -> np.ndarray | None:
    """Compute the corners (2, 3) of the box common to two parts' surfaces; None if there is none."""
    inside = []
    for one, other in ((first, second), (second, first)):
        close = members[one][(np.abs(members[one] - middle) <= half + _NEAR).all(axis=1)]
        if not len(close):
            return None
        local = close @ axes[other].T
        within = ((local >= boxes[other, 0] - TOUCHING) & (local <= boxes[other, 1] + TOUCHING)).all(axis=1)
        inside.append(close[within])
    both = np.concatenate(inside)
    if not len(both):
        oblique = any((axes[part] != np.eye(3)).any() for part in (first, second))
        return None if oblique else np.stack([middle - half, middle + half])
    low = np.maximum(both.min(axis=0) - TOUCHING, middle - half)
    high = np.minimum(both.max(axis=0) + TOUCHING, middle + half)
    return np.stack([np.minimum(low, high), np.maximum(low, high)])


def _world_boxes(axes: np.ndarray, boxes: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Compute lowest and highest coordinates (C, 3) of oriented boxes."""
    middle = np.einsum("ckj,ck->cj", axes, boxes.mean(axis=1))
    reach = np.einsum("ckj,ck->cj", np.abs(axes), (boxes[:, 1] - boxes[:, 0]) / 2)
    return middle - reach, middle + reach
