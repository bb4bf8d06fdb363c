"""Parametric primitives that furniture is built from: closed, outward-wound, few triangles.

Metres, y up, front +z. Sizes are (width x, height y, depth z) unless a docstring says otherwise.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from kpred.synthetic.assembly import assemble, cuboid_mesh
from kpred.synthetic.outlines import ellipse, rounded_rectangle, triangulate
from kpred.synthetic.part import Number, Part, Vector, rotation_between, rotation_matrix

__all__ = [
    "Part",
    "Vector",
    "assemble",
    "beam",
    "box",
    "cuboid_mesh",
    "curved_panel",
    "cushion",
    "cylinder",
    "ellipse",
    "frustum",
    "lathe",
    "loft",
    "rotation_between",
    "rotation_matrix",
    "rounded_rectangle",
    "slab",
    "sweep",
]


def _vector(values: Vector) -> np.ndarray:
    return np.asarray(values, dtype=np.float64)


def _circle(sides: int) -> np.ndarray:
    angles = 2.0 * np.pi * np.arange(sides) / sides
    return np.column_stack([np.cos(angles), np.sin(angles)])


def loft(rings: np.ndarray, label: str, cap: np.ndarray | None = None, axes: np.ndarray | None = None) -> Part:
    """Build a skin over rings (K, M, 3) of equal vertex count, closed at both ends.

    `cap` (T, 3) triangulates one ring (a fan from its first vertex by default). The part's `ring` is M.
    """
    count, size = rings.shape[:2]
    if cap is None:
        cap = np.array([[0, i, i + 1] for i in range(1, size - 1)])
    here = np.arange(size)
    after = (here + 1) % size
    faces = []
    for k in range(count - 1):
        low, high = k * size, (k + 1) * size
        faces.append(np.column_stack([low + here, low + after, high + after]))
        faces.append(np.column_stack([low + here, high + after, high + here]))
    faces.append(cap[:, ::-1])
    faces.append(cap + (count - 1) * size)
    vertices = rings.reshape(-1, 3).astype(np.float64)
    triangles = np.concatenate(faces).astype(np.int64)
    corners = vertices[triangles]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    # A ring may have either winding; the sign of the enclosed volume, about the middle for precision, decides it.
    if np.einsum("ij,ij->", corners[:, 0] - vertices.mean(axis=0), normals) < 0.0:
        triangles = triangles[:, ::-1].copy()
    kept = np.linalg.norm(normals, axis=1) > 1e-10
    return Part(vertices, triangles[kept], label, np.eye(3) if axes is None else axes, size)


def box(size: Vector, center: Vector, label: str) -> Part:
    """Build an axis-aligned box of `size` (width, height, depth) about `center`."""
    width, height, depth = _vector(size)
    x, y, z = _vector(center)
    half = height / 2.0
    return frustum((width, depth), (width, depth), (x, y - half, z), (x, y + half, z), label)


def frustum(bottom_size: Vector, top_size: Vector, bottom_center: Vector, top_center: Vector, label: str) -> Part:
    """Build a hexahedron between two horizontal rectangles (width x, depth z): tapered and splayed legs."""
    corners = np.array([[-0.5, -0.5], [0.5, -0.5], [0.5, 0.5], [-0.5, 0.5]])
    rings = []
    for size, center in ((bottom_size, bottom_center), (top_size, top_center)):
        plan = corners * _vector(size)
        rings.append(np.column_stack([plan[:, 0], np.zeros(4), plan[:, 1]]) + _vector(center))
    axes = rotation_between((0.0, 1.0, 0.0), _vector(top_center) - _vector(bottom_center)).T
    return loft(np.stack(rings), label, axes=axes)


def splayed_legs(
    head: tuple[Number, Number],
    out: Number,
    foot: tuple[Number, Number],
    section: tuple[Number, Number],
    height: Number,
) -> list[Part]:
    """Build four legs under (±x, ±z) at `height`, each side `out` farther out on the floor, of section `foot` there."""
    (x, z), ends = head, (-1, 1)
    return [
        frustum(foot, section, (a * (x + out), 0, b * (z + out)), (a * x, height, b * z), "leg")
        for a in ends
        for b in ends
    ]


def cylinder(
    radius: Number, start: Vector, end: Vector, label: str, sides: int = 16, end_radius: Number | None = None
) -> Part:
    """Round bar from `start` to `end`; `end_radius` makes it a cone frustum."""
    top = radius if end_radius is None else end_radius
    start, end = _vector(start), _vector(end)
    turn = rotation_between((0.0, 1.0, 0.0), end - start)
    plan = _circle(sides)
    disc = np.column_stack([plan[:, 0], np.zeros(sides), plan[:, 1]]) @ turn.T
    return loft(np.stack([disc * radius + start, disc * top + end]), label, axes=turn.T)


def lathe(profile: Sequence[Vector] | np.ndarray, center: Vector, label: str, sides: int = 16) -> Part:
    """Build a solid of revolution about y; `profile` (K, 2) holds (radius, height) from below."""
    rows = np.asarray(profile, dtype=np.float64)
    plan = _circle(sides)
    # A radius of zero would leave triangles without area.
    radii = np.maximum(rows[:, 0], 1e-3)
    rings = np.stack(
        [
            np.column_stack([plan[:, 0] * r, np.full(sides, height), plan[:, 1] * r])
            for r, height in zip(radii, rows[:, 1], strict=True)
        ]
    )
    return replace(loft(rings + _vector(center), label), ring=0)


def sweep(section: np.ndarray, path: np.ndarray, label: str, scales: Vector | None = None) -> Part:
    """Sweep a section (M, 2) along an open path (N, 3), capped at both ends.

    The section's first coordinate starts horizontal (across the path), its second one as near to +y as the path
    allows (to -z for a path that starts vertical). `scales` (N,) resizes the section along the path. Sections are
    mitred at bends so that the bar keeps its thickness.
    """
    points, outline = _vector(path), _vector(section)
    sizes = np.ones(len(points)) if scales is None else _vector(scales)
    segments = np.diff(points, axis=0)
    segments /= np.linalg.norm(segments, axis=1, keepdims=True)
    up = np.array([0.0, 1.0, 0.0]) if abs(segments[0, 1]) < 0.95 else np.array([0.0, 0.0, -1.0])
    across = np.cross(segments[0], up)
    across /= np.linalg.norm(across)
    over = np.cross(across, segments[0])
    rings, direction = [], segments[0]
    for k, point in enumerate(points):
        following = segments[min(k, len(segments) - 1)]
        ring = (outline[:, :1] * across + outline[:, 1:] * over) * sizes[k]
        if k > 0:
            normal = direction + following
            normal /= np.linalg.norm(normal)
            # Slide the section along the incoming bar until it lies in the plane that halves the bend.
            ring = ring - np.outer(ring @ normal / (direction @ normal), direction)
            turn = rotation_between(direction, following)
            across, over = turn @ across, turn @ over
        rings.append(ring + point)
        direction = following
    chord = points[-1] - points[0]
    length = float(np.linalg.norm(chord))
    axes = np.eye(3)
    if length > 0.3 * float(np.linalg.norm(np.diff(points, axis=0), axis=1).sum()):
        forward = chord / length
        side = np.cross(forward, up if abs(forward @ up) < 0.95 else np.array([1.0, 0.0, 0.0]))
        side /= np.linalg.norm(side)
        axes = np.stack([side, np.cross(side, forward), forward])
    return loft(np.stack(rings), label, triangulate(outline), axes)


def beam(start: Vector, end: Vector, width: Number, depth: Number, label: str) -> Part:
    """Build a straight bar of rectangular section; `width` is horizontal, `depth` the other side.

    For an upright bar `width` lies along x and `depth` along z.
    """
    half_width, half_depth = width / 2.0, depth / 2.0
    section = np.array(
        [[-half_width, -half_depth], [half_width, -half_depth], [half_width, half_depth], [-half_width, half_depth]]
    )
    return sweep(section, np.stack([_vector(start), _vector(end)]), label)


def slab(outline: np.ndarray, bottom: Number, thickness: Number, label: str) -> Part:
    """Build a flat board of simple outline (M, 2) in x-z, from height `bottom` to `bottom + thickness`."""
    plan = _vector(outline)
    rings = np.stack(
        [np.column_stack([plan[:, 0], np.full(len(plan), y), plan[:, 1]]) for y in (bottom, bottom + thickness)]
    )
    return loft(rings, label, triangulate(plan))


def cushion(size: Vector, center: Vector, label: str, radius: Number = 0.04, segments: int = 2) -> Part:
    """Build an upholstered block of outer `size` about `center` with rounded edges."""
    width, height, depth = _vector(size)
    radius = min(radius, 0.49 * width, 0.49 * depth, 0.49 * height)
    rings = []
    angles = np.linspace(0.0, np.pi / 2.0, segments + 1)
    for side, steps in ((-1.0, angles), (1.0, angles[::-1])):
        for angle in steps:
            inset = radius * (1.0 - np.sin(angle)) * 0.8
            plan = rounded_rectangle(width - 2.0 * inset, depth - 2.0 * inset, radius, segments)
            y = side * (height / 2.0 - radius + radius * np.cos(angle))
            rings.append(np.column_stack([plan[:, 0], np.full(len(plan), y), plan[:, 1]]))
    return replace(loft(np.stack(rings) + _vector(center), label), ring=0)


def curved_panel(
    width: Number,
    height: Number,
    thickness: Number,
    bow: Number,
    lean: Number,
    center: Vector,
    label: str,
    segments: int = 8,
) -> Part:
    """Build an upright panel about `center`, facing +z.

    `bow`: metres by which the middle lies behind the two side edges (negative bulges to the front).
    `lean`: degrees by which the top tips to the back (-z) about the panel's centre.
    """
    rings = []
    for x in np.linspace(-width / 2.0, width / 2.0, segments + 1):
        z = bow * ((2.0 * x / width) ** 2 - 0.5)
        y0, y1, z0, z1 = -height / 2.0, height / 2.0, z - thickness / 2.0, z + thickness / 2.0
        rings.append([[x, y0, z0], [x, y0, z1], [x, y1, z1], [x, y1, z0]])
    return loft(np.array(rings), label).rotated("x", -lean).moved(center)
