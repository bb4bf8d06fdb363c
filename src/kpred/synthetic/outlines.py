"""Plane outlines of tops, seats and sections, and their triangulation."""

from __future__ import annotations

import numpy as np

from kpred.synthetic.part import Number


def rounded_rectangle(width: Number, depth: Number, radius: Number, segments: int = 4) -> np.ndarray:
    """Return the outline (4 * (segments + 1), 2) of a rectangle about the origin with corners of `radius`.

    A radius of zero gives the four plain corners; radii above half of the smaller side are cut to it.
    """
    radius = min(radius, 0.499 * width, 0.499 * depth)
    if radius <= 1e-6:
        return np.array([[1.0, 1.0], [-1.0, 1.0], [-1.0, -1.0], [1.0, -1.0]]) * np.array([width, depth]) / 2.0
    points = []
    for corner, (sx, sz) in enumerate(((1.0, 1.0), (-1.0, 1.0), (-1.0, -1.0), (1.0, -1.0))):
        angles = np.pi / 2.0 * (corner + np.linspace(0.0, 1.0, segments + 1))
        middle = np.array([sx * (width / 2.0 - radius), sz * (depth / 2.0 - radius)])
        points.append(middle + radius * np.column_stack([np.cos(angles), np.sin(angles)]))
    return np.concatenate(points)


def ellipse(width: Number, depth: Number, segments: int = 24) -> np.ndarray:
    """Return the outline (segments, 2) of an ellipse about the origin with full axes `width` (x) and `depth` (z)."""
    angles = 2.0 * np.pi * np.arange(segments) / segments
    return np.column_stack([np.cos(angles) * width / 2.0, np.sin(angles) * depth / 2.0])


def _cross(a: np.ndarray, b: np.ndarray, c: np.ndarray) -> float:
    return float((b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0]))


def signed_area(outline: np.ndarray) -> float:
    """Compute the area of a simple outline (M, 2), positive when it runs counter-clockwise."""
    x, y = outline[:, 0], outline[:, 1]
    return float(0.5 * np.sum(x * np.roll(y, -1) - y * np.roll(x, -1)))


def triangulate(outline: np.ndarray) -> np.ndarray:
    """Triangulate a simple outline (M, 2) to (M - 2, 3) of the same winding, by clipping ears."""
    order = list(range(len(outline)))
    points = outline if signed_area(outline) > 0.0 else outline * np.array([-1.0, 1.0])
    turns = [_cross(points[i - 1], points[i], points[(i + 1) % len(points)]) for i in order]
    if min(turns) > 0.0:
        return np.array([[0, i, i + 1] for i in range(1, len(outline) - 1)])
    triangles = []
    while len(order) > 3:
        for k in range(len(order)):
            i, j, m = order[k - 1], order[k], order[(k + 1) % len(order)]
            a, b, c = points[i], points[j], points[m]
            if _cross(a, b, c) <= 1e-14:
                continue
            others = (points[n] for n in order if n not in (i, j, m))
            if any(min(_cross(a, b, p), _cross(b, c, p), _cross(c, a, p)) >= 0.0 for p in others):
                continue
            break
        else:
            # Only collinear corners are left: any cut is as good as another.
            k = 0
            i, j, m = order[-1], order[0], order[1]
        triangles.append([i, j, m])
        del order[k]
    triangles.append(order)
    return np.array(triangles)
