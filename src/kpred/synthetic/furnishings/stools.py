"""Families of stools: seats without a back for one."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from kpred.synthetic.chair.bases import cross_base, disc_base, pedestal_base, star_base, tulip_base
from kpred.synthetic.chance import between, happens, pick, whole
from kpred.synthetic.part import Number
from kpred.synthetic.parts import Part, box, cushion, cylinder, frustum, lathe, rounded_rectangle, slab
from kpred.synthetic.table.legs import any_leg_style, four_legs

Family = Callable[[np.random.Generator], list[Part]]


def _round_seat(rng: np.random.Generator, radius: Number, top: Number, thick: Number) -> Part:
    soft = min(0.4 * thick, between(rng, 0.003, 0.03))
    rows = [(radius - soft, 0), (radius, soft), (radius, thick - soft), (radius - soft, thick)]
    return lathe(rows, (0, top - thick, 0), "seat", 22)


def round_stool(rng: np.random.Generator) -> list[Part]:
    """Build a round seat on three or four splayed legs, with a ring or bars between them."""
    top, radius, thick = between(rng, 0.4, 0.82), between(rng, 0.14, 0.22), between(rng, 0.025, 0.08)
    count, out, leg = pick(rng, (3, 4, 4)), between(rng, 0.0, 0.12), between(rng, 0.012, 0.024)
    parts = [_round_seat(rng, radius, top, thick)]
    angles = 2 * np.pi * (np.arange(count) + 0.5) / count
    heads = np.stack([np.cos(angles), np.zeros(count), np.sin(angles)], axis=1) * radius * 0.72
    feet = heads * (1 + out / (radius * 0.72))
    rise = np.array([0, top - thick + 0.005, 0])
    parts += [
        cylinder(0.75 * leg, foot, head + rise, "leg", 8, end_radius=leg)
        for foot, head in zip(feet, heads, strict=True)
    ]
    if happens(rng, 0.7):
        f = between(rng, 0.2, 0.5)
        level = [foot * (1 - f) + (head + rise) * f for foot, head in zip(feet, heads, strict=True)]
        parts += [cylinder(0.6 * leg, level[k], level[(k + 1) % count], "stretcher", 6) for k in range(count)]
    return parts


def square_stool(rng: np.random.Generator) -> list[Part]:
    """Build a square or oblong seat on four legs of a table's styles."""
    top, width, depth = between(rng, 0.38, 0.78), between(rng, 0.28, 0.55), between(rng, 0.26, 0.4)
    thick, padded = between(rng, 0.02, 0.04), happens(rng, 0.4)
    parts = four_legs(
        rng,
        width - 0.02,
        depth - 0.02,
        top - thick,
        any_leg_style(rng, top, ("square", "tapered", "round", "turned", "hairpin", "cabriole")),
        between(rng, 0.0, 0.08),
        happens(rng, 0.5),
    )
    if padded:
        return [*parts, cushion((width, thick + 0.05, depth), (0, top - thick / 2 + 0.025, 0), "seat", 0.02, 3)]
    return [*parts, slab(rounded_rectangle(width, depth, between(rng, 0, 0.06), 3), top - thick, thick, "seat")]


def swivel_stool(rng: np.random.Generator) -> list[Part]:
    """Build a round seat on a column with a star, disc or tulip foot."""
    top, radius, thick = between(rng, 0.42, 0.8), between(rng, 0.16, 0.22), between(rng, 0.04, 0.1)
    base = pick(rng, ("star", "disc", "tulip", "cross"))
    reach = between(rng, 0.19, 0.28)
    if base == "star":
        parts = star_base(rng, top - thick + 0.01, reach, happens(rng, 0.7))
    elif base == "disc":
        parts = disc_base(rng, top - thick + 0.01, reach * 0.9)
    else:
        parts = (tulip_base if base == "tulip" else cross_base)(rng, top - thick + 0.01, reach)
    parts.append(_round_seat(rng, radius, top, thick))
    if top > 0.6 and happens(rng, 0.6):
        rest = between(rng, 0.2, 0.3)
        angles = np.linspace(0, 2 * np.pi, 17)
        rim = np.column_stack([np.cos(angles), np.zeros(17), np.sin(angles)]) * 0.17 + (0, rest, 0)
        parts += [cylinder(0.009, a, b, "foot_rest", 6) for a, b in zip(rim[:-1], rim[1:], strict=True)]
        parts.append(cylinder(0.008, (-0.17, rest, 0), (0.17, rest, 0), "foot_rest", 6))
    return parts


def pouf(rng: np.random.Generator) -> list[Part]:
    """Build a soft block or drum, perhaps on short feet."""
    top, feet = between(rng, 0.3, 0.48), pick(rng, (0.0, 0.0, between(rng, 0.03, 0.12)))
    if happens(rng, 0.45):
        radius, bulge = between(rng, 0.2, 0.45), between(rng, 0.0, 0.06)
        rows = [
            (radius - 0.03, 0),
            (radius, 0.04),
            (radius + bulge, (top - feet) / 2),
            (radius, top - feet - 0.04),
            (radius - 0.04, top - feet),
        ]
        parts, reach = [lathe(rows, (0, feet, 0), "seat", 24)], 1.1 * radius
        depth = reach
    else:
        reach, depth = between(rng, 0.38, 1.2), between(rng, 0.36, 0.7)
        parts = [cushion((reach, top - feet, depth), (0, (top + feet) / 2, 0), "seat", between(rng, 0.02, 0.06), 3)]
    if feet:
        parts += [
            frustum(
                (0.03, 0.03),
                (0.045, 0.045),
                (a * 0.42 * reach, 0, b * 0.42 * depth),
                (a * 0.4 * reach, feet + 0.01, b * 0.4 * depth),
                "leg",
            )
            for a in (-1, 1)
            for b in (-1, 1)
        ]
    return parts


def step_stool(rng: np.random.Generator) -> list[Part]:
    """Build two or three steps between side boards, rising to the back."""
    count, width, rise, run = (
        whole(rng, 2, 3),
        between(rng, 0.35, 0.5),
        between(rng, 0.19, 0.26),
        between(rng, 0.16, 0.24),
    )
    parts = [
        box((width, 0.025, run + 0.02), (0, (k + 1) * rise, (count / 2 - k - 0.5) * run), "step") for k in range(count)
    ]
    outline = [(count / 2 * run, 0.0)]
    for k in range(count):
        outline += [
            ((count / 2 - k) * run, (k + 1) * rise - 0.012),
            ((count / 2 - k - 1) * run, (k + 1) * rise - 0.012),
        ]
    profile = np.array([*outline, (-count / 2 * run, 0.0)])
    for side in (-1, 1):
        board = slab(profile, 0, 0.02, "side").rotated("x", -90).rotated("y", -90)
        low, high = board.vertices.min(axis=0), board.vertices.max(axis=0)
        parts.append(
            board.moved((side * (width / 2 - 0.01) - (low[0] + high[0]) / 2, -low[1], -(low[2] + high[2]) / 2))
        )
    return parts


def hocker(rng: np.random.Generator) -> list[Part]:
    """Build a stool of boards: two sides or a pedestal below a flat seat."""
    top, width, depth, thick = (
        between(rng, 0.38, 0.5),
        between(rng, 0.3, 0.5),
        between(rng, 0.28, 0.4),
        between(rng, 0.018, 0.04),
    )
    parts = [box((width, thick, depth), (0, top - thick / 2, 0), "seat")]
    if happens(rng, 0.25):
        return [*parts, *pedestal_base(rng, top - thick, 0.7 * width)]
    inset = between(rng, 0.0, 0.06)
    parts += [
        box((thick, top - thick, 0.96 * depth), (s * (width / 2 - thick / 2 - inset), (top - thick) / 2, 0), "side")
        for s in (-1, 1)
    ]
    return [*parts, box((width - 2 * inset, thick, thick * 2.5), (0, top * between(rng, 0.2, 0.8), 0), "stretcher")]


STOOL_FAMILIES: dict[str, Family] = {
    "round_stool": round_stool,
    "square_stool": square_stool,
    "swivel_stool": swivel_stool,
    "pouf": pouf,
    "step_stool": step_stool,
    "hocker": hocker,
}
