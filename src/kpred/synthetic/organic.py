"""Rounded primitives for what is no furniture: ellipsoids, capsules, bumpy blobs, leaves, rings and vessels.

Metres, y up. All are closed and outward-wound, like those of `parts`.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from kpred.synthetic.part import Number, Part, Vector, rotation_between
from kpred.synthetic.parts import ellipse, lathe, loft, sweep
from kpred.synthetic.paths import bezier


def rotated(part: Part, rotation: np.ndarray, offset: Vector = (0.0, 0.0, 0.0)) -> Part:
    """Rotate the part about the origin by a matrix (3, 3), then shift it by `offset`."""
    moved = part.vertices @ rotation.T + np.asarray(offset, dtype=np.float64)
    return replace(part, vertices=moved, axes=part.axes @ rotation.T)


def ellipsoid(radii: Vector, center: Vector, label: str, sides: int = 12, rings: int = 8) -> Part:
    """Build an axis-aligned ellipsoid with the half axes `radii` (3,)."""
    angles = np.linspace(-np.pi / 2.0, np.pi / 2.0, rings + 1)
    ball = lathe(np.column_stack([np.cos(angles), np.sin(angles)]), (0.0, 0.0, 0.0), label, sides)
    return ball.scaled(radii).moved(center)


def capsule(start: Vector, end: Vector, radius: Number, label: str, end_radius: Number | None = None) -> Part:
    """Round bar from `start` to `end` with half balls at its ends; `end_radius` tapers it."""
    top = radius if end_radius is None else end_radius
    first, last = np.asarray(start, dtype=np.float64), np.asarray(end, dtype=np.float64)
    length = float(np.linalg.norm(last - first))
    low, high = np.radians([-90.0, -60.0, -30.0, 0.0]), np.radians([0.0, 30.0, 60.0, 90.0])
    profile = np.concatenate(
        [
            np.column_stack([radius * np.cos(low), radius * np.sin(low)]),
            np.column_stack([top * np.cos(high), length + top * np.sin(high)]),
        ]
    )
    bar = lathe(profile, (0.0, 0.0, 0.0), label, sides=10)
    return rotated(bar, rotation_between((0.0, 1.0, 0.0), last - first), first)


def bumpy_ball(
    rng: np.random.Generator, radii: Vector, center: Vector, label: str, bump: Number = 0.3, waves: int = 6
) -> Part:
    """Build an ellipsoid with `waves` smooth random waves, up to about `bump` of its radius."""
    ball = ellipsoid((1.0, 1.0, 1.0), (0.0, 0.0, 0.0), label, sides=20, rings=14)
    directions = ball.vertices
    swell = np.zeros(len(directions))
    for _ in range(waves):
        swell += np.sin(directions @ rng.normal(0.0, 2.2, 3) + rng.uniform(0.0, 2.0 * np.pi))
    factor = 1.0 + bump * swell / waves**0.5 / 1.5
    return replace(ball, vertices=directions * np.clip(factor, 0.3, 2.0)[:, None]).scaled(radii).moved(center)


def leaf(start: Vector, tip: Vector, width: Number, droop: Number, label: str = "leaf") -> Part:
    """Thin pointed leaf from `start` to `tip`; its middle rises `droop` metres over the straight line."""
    first, last = np.asarray(start, dtype=np.float64), np.asarray(tip, dtype=np.float64)
    path = bezier(first, (first + last) / 2.0 + np.array([0.0, 2.0 * droop, 0.0]), last, segments=6)
    scales = np.array([0.25, 0.75, 1.0, 0.95, 0.75, 0.45, 0.12])
    return sweep(ellipse(width, max(0.004, 0.04 * width), 6), path, label, scales)


def ring(radius: Number, thickness: Number, center: Vector, label: str, sides: int = 24) -> Part:
    """Build an upright tyre in the x-y plane: a bar of round section, `thickness` across, on a circle of `radius`."""
    angles = np.linspace(0.0, 2.0 * np.pi, sides + 1)
    path = np.column_stack([np.cos(angles), np.sin(angles), np.zeros(sides + 1)]) * radius
    return sweep(ellipse(thickness, thickness, 6), path, label).moved(center)


def vessel(plans: Sequence[np.ndarray], heights: Sequence[Number], wall: Number, label: str) -> Part:
    """Open hollow body over convex plans (each (M, 2), x-z) at rising `heights`, with walls and a floor of `wall`."""
    outer = [np.column_stack([plan[:, 0], np.full(len(plan), y), plan[:, 1]]) for plan, y in zip(plans, heights)]
    inner = []
    for k in range(len(plans) - 1, -1, -1):
        middle = outer[k].mean(axis=0)
        reach = np.abs(outer[k] - middle)[:, [0, 2]].max(axis=0)
        shrink = np.maximum(1.0 - wall / reach, 0.3)
        inside = middle + (outer[k] - middle) * np.array([shrink[0], 1.0, shrink[1]])
        inner.append(inside + np.array([0.0, wall if k == 0 else 0.0, 0.0]))
    return loft(np.stack([*outer, *inner]), label)
