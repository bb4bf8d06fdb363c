"""Directions that a part is built along: the axes of its own box."""

from __future__ import annotations

from itertools import permutations

import numpy as np

from kpred.ops.typing import Float

ALIGNED = np.cos(np.radians(1.0))
"""A facet whose normal is within a degree of an axis lies along the axes."""

MIN_ALIGNED = 0.6
"""Fraction of a part's area that must lie along the axes for the part to do so."""

_SAME_NORMAL = np.cos(np.radians(3.0))
_SQUARE = np.sin(np.radians(6.0))


def own_axes(
    normals: Float[np.ndarray, "faces 3"],
    areas: Float[np.ndarray, " faces"],
    planar: Float[np.ndarray, " faces"],
    vertices: Float[np.ndarray, "vertices 3"],
) -> Float[np.ndarray, "3 3"]:
    """Find the directions (rows, right-handed, near x, y and z) that a part is built along.

    Args:
        normals: unit normals of the part's faces, of either sign; areas: of the faces; planar: 1 for faces of planar
            facets, 0 for curved ones; vertices: of the part.

    Largest planar facets give the directions; of a part that is mostly curved, the principal axes of its vertices.
    """
    total = float(areas.sum())
    along_axes = np.abs(normals).max(axis=1) > ALIGNED
    if not total > 0 or float(areas[along_axes].sum()) >= MIN_ALIGNED * total:
        return np.eye(3)
    flat = areas * planar
    if float(flat.sum()) >= 0.3 * total:
        first = _dominant(normals, flat)
        across = np.where(np.abs(normals @ first) < _SQUARE, flat, 0.0)
        second = _dominant(normals, across) if across.sum() > 0 else _longest_across(vertices, first)
        second = second - (second @ first) * first
        second /= np.linalg.norm(second)
        found = np.stack([first, second, np.cross(first, second)])
    else:
        found = _principal(vertices)
    return _named(found)


def mirrored_axes(axes: Float[np.ndarray, "3 3"]) -> Float[np.ndarray, "3 3"]:
    """Mirror the axes of a part left to right, so that they stay right-handed and near x, y and z."""
    mirror = np.diag([-1.0, 1.0, 1.0])
    found: np.ndarray = mirror @ axes @ mirror
    return found


def symmetric_axes(axes: Float[np.ndarray, "3 3"]) -> Float[np.ndarray, "3 3"]:
    """Rotate the axes of a part that is its own mirror image so that the first is x: the part leans back or not."""
    second = np.array([0.0, axes[1, 1], axes[1, 2]])
    length = float(np.linalg.norm(second))
    if length < 1e-6:
        return np.eye(3)
    first, second = np.array([1.0, 0.0, 0.0]), second / length
    return _named(np.stack([first, second, np.cross(first, second)]))


def _dominant(normals: np.ndarray, weight: np.ndarray) -> np.ndarray:
    """Return the mean of the normals around the one of the largest weight, ignoring signs."""
    first = normals[int(weight.argmax())]
    cosine = normals @ first
    near = np.where(np.abs(cosine) > _SAME_NORMAL, weight * np.sign(cosine), 0.0)
    mean = near @ normals
    found: np.ndarray = mean / np.linalg.norm(mean)
    return found


def _longest_across(vertices: np.ndarray, normal: np.ndarray) -> np.ndarray:
    """Return the direction of largest spread perpendicular to a normal."""
    centred = vertices - vertices.mean(axis=0)
    centred = centred - np.outer(centred @ normal, normal)
    direction: np.ndarray = np.linalg.eigh(centred.T @ centred)[1][:, 2]
    return direction


def _principal(vertices: np.ndarray) -> np.ndarray:
    """Return principal axes, longest first; world axes complete equal spreads."""
    centred = vertices - vertices.mean(axis=0)
    values, vectors = np.linalg.eigh(centred.T @ centred / len(vertices))
    spread = np.sqrt(np.maximum(values, 0.0))
    if spread[2] < 1.1 * spread[0] or spread[2] <= 0:
        return np.eye(3)
    if spread[1] < 1.15 * spread[0]:  # long, round
        first = vectors[:, 2]
    elif spread[2] < 1.15 * spread[1]:  # flat, round
        first = vectors[:, 0]
    else:
        return vectors.T
    helper = np.eye(3)[int(np.abs(first).argmin())]
    second = helper - (helper @ first) * first
    second /= np.linalg.norm(second)
    return np.stack([first, second, np.cross(first, second)])


def _named(axes: np.ndarray) -> np.ndarray:
    """Sort directions as rows near x, y and z; the identity if they are within a degree of it."""
    best = max(permutations(range(3)), key=lambda order: sum(abs(axes[order[k], k]) for k in range(3)))
    ordered = axes[list(best)]
    ordered = ordered * np.where(np.diag(ordered) < 0, -1.0, 1.0)[:, None]
    if np.linalg.det(ordered) < 0:
        ordered[int(np.abs(np.diag(ordered)).argmin())] *= -1.0
    return np.eye(3) if np.diag(ordered).min() > ALIGNED else ordered
