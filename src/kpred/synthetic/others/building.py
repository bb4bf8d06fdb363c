"""Pieces of buildings that crops of scans hold: walls, corners, floors, stairs, columns, radiators, curtains."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from kpred.synthetic.chance import between, happens, pick, whole
from kpred.synthetic.parts import Part, beam, box, cylinder, lathe, loft, slab

Family = Callable[[np.random.Generator], list[Part]]


def _rectangle(width: float, depth: float) -> np.ndarray:
    return np.array([[0.5, 0.5], [-0.5, 0.5], [-0.5, -0.5], [0.5, -0.5]]) * (width, depth)


def _ragged(rng: np.random.Generator, width: float, depth: float) -> np.ndarray:
    """Draw the outline (M, 2) of a crop about the origin: a rectangle or an irregular shape."""
    if happens(rng, 0.4):
        return _rectangle(width, depth)
    angles = np.linspace(0.0, 2.0 * np.pi, whole(rng, 7, 20), endpoint=False)
    circle = np.column_stack([np.cos(angles), np.sin(angles)])
    square = circle / np.abs(circle).max(axis=1, keepdims=True)
    fraction = between(rng, 0.0, 1.0)
    outline = (fraction * circle + (1.0 - fraction) * square) * rng.uniform(0.6, 1.0, (len(angles), 1))
    return outline * (width / 2.0, depth / 2.0)


def _wall(rng: np.random.Generator, width: float, height: float, thickness: float, ragged: bool = False) -> list[Part]:
    """Build a wall about x = 0, its face at z = 0, with a door, a window or nothing.

    With `ragged` a wall without an opening may end anywhere, as crops do; it is then about as wide and high as said.
    """
    z = -thickness / 2.0
    opening = pick(rng, ["none", "door", "window"], (3, 1, 1))
    if opening == "none" or width < 1.0 or height < 1.0:
        outline = _ragged(rng, width, height) if ragged else _rectangle(width, height)
        board = slab(outline, 0.0, thickness, "wall").rotated("x", 90.0)
        return [board.moved((0.0, -board.vertices[:, 1].min(), -board.vertices[:, 2].max()))]
    left, right = np.sort(rng.uniform(-0.42, 0.42, 2)) * width
    right = max(right, left + 0.3 * width)
    low = 0.0 if opening == "door" else height * between(rng, 0.2, 0.4)
    high = height * between(rng, 0.7, 0.9)
    edges = [
        ((left + width / 2.0, height), (-width / 2.0 + left) / 2.0, height / 2.0),
        ((max(width / 2.0 - right, 0.05), height), right + max(width / 2.0 - right, 0.05) / 2.0, height / 2.0),
        ((right - left, height - high), (left + right) / 2.0, (height + high) / 2.0),
    ]
    if low > 0.0:
        edges.append(((right - left, low), (left + right) / 2.0, low / 2.0))
    parts = [box((size[0], size[1], thickness), (x, y, z), "wall") for size, x, y in edges]
    if happens(rng, 0.5):
        middle = ((left + right) / 2.0, (low + high) / 2.0)
        leaf = box((right - left, high - low, 0.03), (middle[0], middle[1], z), "pane")
        parts.append(leaf.rotated("y", between(rng, 0.0, 80.0), (left, 0.0, z)) if opening == "door" else leaf)
    return parts


def _thickness(rng: np.random.Generator) -> float:
    # A scan sees one face of a wall only: very thin ones are the rule.
    return between(rng, 0.01, 0.04) if happens(rng, 0.6) else between(rng, 0.04, 0.3)


def wall(rng: np.random.Generator) -> list[Part]:
    """Build a piece of a wall."""
    return _wall(rng, between(rng, 0.4, 4.0), between(rng, 0.4, 2.8), _thickness(rng), ragged=True)


def corner(rng: np.random.Generator) -> list[Part]:
    """Build two walls that meet, with or without the floor between them."""
    height, thickness = between(rng, 0.5, 2.8), _thickness(rng)
    first, second = between(rng, 0.4, 3.0), between(rng, 0.4, 3.0)
    back = _wall(rng, first, height, thickness)
    side = [part.moved((0.0, 0.0, -first / 2.0)) for part in _wall(rng, second, height, thickness)]
    side = [part.rotated("y", 90.0).moved((0.0, 0.0, second / 2.0)) for part in side]
    parts = back + side
    if happens(rng, 0.5):
        parts.append(box((first, 0.02, second), (0.0, -0.01, second / 2.0), "floor"))
    return parts


def floor(rng: np.random.Generator) -> list[Part]:
    """Build a flat piece of a floor or ceiling, sometimes with a step or a low stub on it."""
    width, depth = between(rng, 0.3, 4.0), between(rng, 0.3, 4.0)
    parts = [slab(_ragged(rng, width, depth), 0.0, between(rng, 0.005, 0.06), "floor")]
    if happens(rng, 0.3):
        height = between(rng, 0.03, 0.2)
        parts.append(box((0.2 * width, height, 0.3 * depth), (0.0, height / 2.0, 0.0), "stub"))
    return parts


def wall_and_floor(rng: np.random.Generator) -> list[Part]:
    """Build a wall that rises from a piece of floor."""
    width, depth = between(rng, 0.4, 3.0), between(rng, 0.2, 2.5)
    parts = _wall(rng, width, between(rng, 0.3, 2.6), _thickness(rng))
    return [*parts, slab(_ragged(rng, width, depth) + (0.0, 0.3 * depth), -0.02, 0.025, "floor")]


def stairs(rng: np.random.Generator) -> list[Part]:
    """Build a solid or open flight of steps that rises to the back."""
    count, width = whole(rng, 3, 14), between(rng, 0.6, 1.6)
    rise, run = between(rng, 0.14, 0.2), between(rng, 0.22, 0.34)
    solid = happens(rng, 0.5)
    parts = []
    for k in range(count):
        height = (k + 1) * rise if solid else 0.04
        parts.append(box((width, height, run + 0.02), (0.0, (k + 1) * rise - height / 2.0, -k * run), "step"))
    if not solid or happens(rng, 0.4):
        for side in (-0.5, 0.5):
            ends = np.array([[side * width, 0.5 * rise, 0.5 * run], [side * width, count * rise, -count * run]])
            parts.append(beam(ends[0], ends[1], 0.04, 0.2, "string"))
            if happens(rng, 0.5):
                up = np.array([0.0, 0.9, 0.0])
                parts.append(beam(ends[0] + up, ends[1] + up, 0.05, 0.05, "handrail"))
                parts += [beam(end, end + up, 0.04, 0.04, "post") for end in ends]
    return parts


def column(rng: np.random.Generator) -> list[Part]:
    """Build a column or pillar with a foot and a head."""
    radius, height = between(rng, 0.08, 0.35), between(rng, 0.9, 3.2)
    wide = radius * between(rng, 1.1, 1.6)
    foot = height * between(rng, 0.02, 0.1)
    if happens(rng, 0.5):
        profile = [(wide, 0.0), (wide, foot), (radius, 1.5 * foot), (0.85 * radius, height - 1.5 * foot)]
        return [lathe([*profile, (wide, height - foot), (wide, height)], (0.0, 0.0, 0.0), "column")]
    parts = [box((2.0 * radius, height, 2.0 * radius), (0.0, height / 2.0, 0.0), "column")]
    for y in (foot / 2.0, height - foot / 2.0):
        parts.append(box((2.0 * wide, foot, 2.0 * wide), (0.0, y, 0.0), "moulding"))
    return parts


def radiator(rng: np.random.Generator) -> list[Part]:
    """Build a row of ribs between two pipes."""
    count, height = whole(rng, 5, 22), between(rng, 0.3, 1.2)
    pitch, depth = between(rng, 0.045, 0.08), between(rng, 0.05, 0.16)
    lift = between(rng, 0.05, 0.2)
    parts = []
    for k in range(count):
        x = (k - (count - 1) / 2.0) * pitch
        parts.append(box((0.6 * pitch, height, depth), (x, lift + height / 2.0, 0.0), "rib"))
    reach = count * pitch / 2.0 + 0.04
    for y in (lift + 0.06, lift + height - 0.06):
        parts.append(cylinder(0.02, (-reach, y, 0.0), (reach, y, 0.0), "pipe", sides=8))
    parts.append(cylinder(0.012, (reach, 0.0, 0.0), (reach, lift + 0.06, 0.0), "pipe", sides=8))
    return parts


def ladder(rng: np.random.Generator) -> list[Part]:
    """Build a leaning ladder or step ladder."""
    height, width = between(rng, 1.0, 3.0), between(rng, 0.3, 0.5)
    lean, rungs = between(rng, 8.0, 25.0), whole(rng, 4, 10)
    parts = [beam((x, 0.0, 0.0), (x, height, 0.0), 0.03, 0.07, "rail") for x in (-width / 2.0, width / 2.0)]
    for k in range(rungs):
        y = height * (k + 0.7) / rungs
        parts.append(beam((-width / 2.0, y, 0.0), (width / 2.0, y, 0.0), 0.06, 0.03, "rung"))
    parts = [part.rotated("x", -lean) for part in parts]
    if happens(rng, 0.5):
        top = np.array([height * np.cos(np.radians(lean)), -height * np.sin(np.radians(lean))])
        for x in (-width / 2.0, width / 2.0):
            parts.append(beam((x, 0.0, 2.0 * top[1]), (x, top[0], top[1]), 0.03, 0.05, "rail"))
    return parts


def curtain(rng: np.random.Generator) -> list[Part]:
    """Build a hanging cloth in folds."""
    width, height, folds = between(rng, 0.4, 2.0), between(rng, 0.8, 2.5), whole(rng, 3, 9)
    depth, thickness = between(rng, 0.02, 0.08), 0.01
    rings = []
    for t in np.linspace(0.0, 1.0, 6 * folds + 1):
        x, z = (t - 0.5) * width, depth * np.sin(2.0 * np.pi * folds * t)
        low = [[x, 0.0, 1.3 * z - thickness], [x, 0.0, 1.3 * z + thickness]]
        rings.append([*low, [x, height, z + thickness], [x, height, z - thickness]])
    return [loft(np.array(rings), "curtain")]


BUILDING_FAMILIES: dict[str, Family] = {
    "wall": wall,
    "corner": corner,
    "floor": floor,
    "wall_and_floor": wall_and_floor,
    "stairs": stairs,
    "column": column,
    "radiator": radiator,
    "ladder": ladder,
    "curtain": curtain,
}
