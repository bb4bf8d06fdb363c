"""Tabletops: the flat thing that a table's legs carry, in the outlines and builds that are common in homes."""

from __future__ import annotations

import numpy as np

from kpred.synthetic.chance import between, happens, pick
from kpred.synthetic.parts import Part, box, ellipse, frustum, rounded_rectangle, slab

RECTANGULAR = ("rectangle", "bevelled", "planks", "framed", "rounded", "octagon")
CURVED = ("oval", "boat", "superellipse", "racetrack")


def cut_corners(width: float, depth: float, cut: float) -> np.ndarray:
    """Return the outline (8, 2) in xz of a rectangle with corners cut at 45 degrees, `cut` metres each."""
    x, z = width / 2, depth / 2
    return np.array(
        [
            (x, -z + cut),
            (x, z - cut),
            (x - cut, z),
            (-x + cut, z),
            (-x, z - cut),
            (-x, -z + cut),
            (cut - x, -z),
            (x - cut, -z),
        ]
    )


def boat(width: float, depth: float, ends: float, segments: int = 8) -> np.ndarray:
    """Return the outline in xz with straight ends `ends` * depth wide and bowed long sides."""
    x = np.linspace(width / 2, -width / 2, segments + 1)
    z = depth / 2 * (ends + (1 - ends) * (1 - (2 * x / width) ** 2))
    return np.concatenate([np.stack([x, z], axis=1), np.stack([x[::-1], -z[::-1]], axis=1)])


def superellipse(width: float, depth: float, power: float, segments: int = 32) -> np.ndarray:
    """Return the outline in xz of |x/a|^p + |z/b|^p = 1: between ellipse (p=2) and rectangle."""
    angle = np.linspace(0, 2 * np.pi, segments, endpoint=False)
    cos, sin = np.cos(angle), np.sin(angle)
    radius = (np.abs(cos) ** power + np.abs(sin) ** power) ** (-1 / power)
    return np.stack([width / 2 * radius * cos, depth / 2 * radius * sin], axis=1)


def tabletop(
    rng: np.random.Generator,
    width: float,
    depth: float,
    height: float,
    thickness: float,
    shape: str,
    label: str = "top",
) -> list[Part]:
    """Build a tabletop of one of the `RECTANGULAR` or `CURVED` shapes whose upper face lies at `height`."""
    bottom = height - thickness
    middle = height - thickness / 2
    if shape == "bevelled":
        shrink = between(rng, 0.02, 0.06)
        return [frustum((width - shrink, depth - shrink), (width, depth), (0, bottom, 0), (0, height, 0), label)]
    if shape == "planks":
        count, gap = int(rng.integers(3, 7)), 0.008
        board = (depth - gap * (count - 1)) / count
        planks = [
            box((width, thickness, board), (0, middle, -depth / 2 + board / 2 + i * (board + gap)), label)
            for i in range(count)
        ]
        battens = [
            box((0.06, 0.02, depth * 0.9), (side * width * 0.36, bottom - 0.008, 0), "batten") for side in (-1, 1)
        ]
        return planks + battens
    if shape == "framed":
        rim, drop = between(rng, 0.05, 0.1), thickness * between(rng, 0.05, 0.4)
        inner = thickness - drop  # down to the frame's lower face, on which bases push
        return [
            box((width, thickness, rim), (0, middle, (depth - rim) / 2), label),
            box((width, thickness, rim), (0, middle, (rim - depth) / 2), label),
            box((rim, thickness, depth - 2 * rim), ((width - rim) / 2, middle, 0), label),
            box((rim, thickness, depth - 2 * rim), ((rim - width) / 2, middle, 0), label),
            box((width - 2 * rim, inner, depth - 2 * rim), (0, height - drop - inner / 2, 0), label),
        ]
    if shape == "rectangle":
        top = [box((width, thickness, depth), (0, middle, 0), label)]
        if happens(rng, 0.15):
            lip = thickness * 0.6
            top.append(box((width - 0.08, lip, depth - 0.08), (0, bottom - lip / 2, 0), label))
        return top
    small = min(width, depth)
    if shape == "rounded":
        outline = rounded_rectangle(width, depth, small * between(rng, 0.06, 0.25), 5)
    elif shape == "racetrack":
        outline = rounded_rectangle(width, depth, small * 0.49, 8)
    elif shape == "octagon":
        outline = cut_corners(width, depth, small * between(rng, 0.1, 0.293))
    elif shape == "boat":
        outline = boat(width, depth, between(rng, 0.55, 0.85))
    elif shape == "superellipse":
        outline = superellipse(width, depth, between(rng, 2.4, 4.0))
    else:
        outline = ellipse(width, depth, 32)
    return [slab(outline, bottom, thickness, label)]


def any_top_shape(rng: np.random.Generator, curved: float = 0.2) -> str:
    """Draw a shape for `tabletop`; one with curved sides with the probability `curved`."""
    if happens(rng, curved):
        return pick(rng, CURVED)
    return pick(rng, RECTANGULAR, (5, 1, 1, 1, 2, 1))


def leg_reach(shape: str) -> float:
    """Return the maximum distance of legs under a top of this shape, as a fraction of its half extents."""
    return {"oval": 0.64, "boat": 0.66, "superellipse": 0.74, "racetrack": 0.7, "octagon": 0.82}.get(shape, 1.0)
