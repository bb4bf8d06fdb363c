"""Tables of offices and halls: lifting and drafting desks, counters, conference and games tables."""

from __future__ import annotations

import numpy as np

from kpred.synthetic.chance import between, happens, pick
from kpred.synthetic.parts import Part, beam, box, cylinder, slab
from kpred.synthetic.table.columns import column
from kpred.synthetic.table.legs import LegStyle, any_leg_style, corners, four_legs, leg_set, rails
from kpred.synthetic.table.tops import superellipse, tabletop


def t_leg_desk(rng: np.random.Generator) -> list[Part]:
    """Build an office desk: a T- or C-shaped foot with a column at each end, and a beam."""
    width, depth, height, thick = between(rng, 1.1, 2.0), between(rng, 0.6, 0.9), between(rng, 0.66, 1.1), 0.025
    head, x = height - thick, width / 2 * between(rng, 0.72, 0.92)
    wide, deep, z = between(rng, 0.05, 0.09), between(rng, 0.06, 0.12), pick(rng, (0.0, -0.15)) * depth
    parts = tabletop(rng, width, depth, height, thick, pick(rng, ("rectangle", "rounded", "rectangle")))
    for side in (-1, 1):
        parts.append(box((wide * 1.1, 0.03, depth * between(rng, 0.8, 0.95)), (side * x, 0.015, 0), "foot"))
        parts.append(box((wide, 0.03, depth * 0.75), (side * x, head - 0.015, 0), "support"))
        for twin in (-0.06, 0.06) if deep > 0.11 else (0.0,):
            parts.append(
                box((wide * 0.8, head - 0.05, deep * (0.6 if twin else 1.0)), (side * x, head / 2, z + twin), "column")
            )
    form = pick(rng, ("beam", "panel", "both"))
    if form != "panel":
        parts.append(box((2 * x, 0.05, 0.04), (0, head - 0.035, z), "beam"))
    if form != "beam":
        tall = between(rng, 0.25, 0.45)
        parts.append(box((2 * x, tall, 0.016), (0, head - tall / 2, z), "panel"))
    if happens(rng, 0.2):
        rise = between(rng, 0.3, 0.5)
        parts.append(box((width, rise + 0.1, 0.025), (0, height + rise / 2 - 0.05, -depth / 2 - 0.01), "screen"))
    return parts


def conference_table(rng: np.random.Generator) -> list[Part]:
    """Build a huge flat top on slab, column or box bases."""
    width = between(rng, 2.2, 4.2)
    depth, height, thick = width / between(rng, 2.0, 3.2), between(rng, 0.72, 0.78), between(rng, 0.025, 0.07)
    shape = pick(rng, ("boat", "racetrack", "rectangle", "rounded", "superellipse", "octagon"))
    head = height - thick
    parts = tabletop(rng, width, depth, height, thick, shape)
    count = 2 if width < 3.0 else pick(rng, (2, 3))
    form = pick(rng, ("slab", "column", "box", "drum"))
    base = column(rng, head, depth * 0.3, (0.0, 0.0)) if form == "column" else []
    for x in np.linspace(-0.3, 0.3, count) * width:
        if form == "slab":
            base = [box((0.06, head, depth * 0.55), (0, head / 2, 0), "base")]
        elif form == "box":
            base = [box((width * 0.12, head, depth * 0.4), (0, head / 2, 0), "base")]
        elif form == "drum":
            base = [cylinder(depth * 0.22, (0, 0, 0), (0, head, 0), "base", 20)]
        parts += [part.moved((float(x), 0, 0)) for part in base]
    if form == "slab":
        parts.append(box((width * 0.6, 0.3, 0.03), (0, head - 0.15, 0), "panel"))
    return parts


def ping_pong_table(rng: np.random.Generator) -> list[Part]:
    """Build a table-tennis table (net, thin top) or a billiard table (deep case, heavy legs)."""
    if happens(rng, 0.4):
        width, depth, height = between(rng, 2.0, 2.8), between(rng, 1.1, 1.5), between(rng, 0.78, 0.86)
        deep, rim = between(rng, 0.14, 0.24), between(rng, 0.09, 0.14)
        style = any_leg_style(rng, height, ("turned", "square", "tapered"))
        style = LegStyle(style.kind, between(rng, 0.11, 0.16), 0.7, 0.0, 0.7)
        parts = rails(width - rim, depth - rim, height - 0.03, 0.06, rim, "rim")
        parts.append(box((width - rim, deep, depth - rim), (0, height - 0.05 - deep / 2, 0), "top"))
        return parts + four_legs(rng, width - 2 * rim, depth - 2 * rim, height - 0.045 - deep, style)
    width, depth, height, thick = between(rng, 2.2, 2.8), between(rng, 1.25, 1.55), between(rng, 0.72, 0.78), 0.025
    parts = [box((width, thick, depth), (0, height - thick / 2, 0), "top")]
    parts += rails(width - 0.1, depth - 0.1, height - thick - 0.03, 0.06, 0.02, "apron")
    x, z = width * between(rng, 0.25, 0.42), depth * 0.36
    parts += leg_set(LegStyle("square", 0.045, 1.0, 0.0, 1.0), [*corners(2 * x, 2 * z)], height - thick)
    for side in (-1, 1):
        parts.append(box((0.03, 0.03, 2 * z), (side * x, 0.15, 0), "stretcher"))
    if happens(rng, 0.8):
        parts.append(box((0.008, 0.15, depth + 0.25), (0, height + 0.074, 0), "net"))
        parts += [
            box((0.03, 0.2, 0.02), (0, height + 0.05, side * (depth / 2 + 0.008)), "net_post") for side in (-1, 1)
        ]
    return parts


def drafting_table(rng: np.random.Generator) -> list[Part]:
    """Build a board tilted towards the sitter on A-shaped or straight ends."""
    width, depth, height, thick = between(rng, 0.8, 1.5), between(rng, 0.6, 0.9), between(rng, 0.75, 0.95), 0.025
    tilt = between(rng, 5, 30)
    low = height - depth / 2 * np.sin(np.radians(tilt))
    top = box((width, thick, depth), (0, 0, 0), "top").rotated("x", tilt).moved((0, height, 0))
    parts = [
        top,
        box((width * 0.9, 0.03, 0.02), (0, 0, 0), "ledge")
        .moved((0, 0.015, depth / 2 - 0.01))
        .rotated("x", tilt)
        .moved((0, height, 0)),
    ]
    x, bar = width * between(rng, 0.33, 0.45), between(rng, 0.03, 0.05)
    # Uprights end inside the tilted board, so that it rests on all four of them.
    for side in (-1, 1):
        for z in (-1, 1):
            at = z * depth * 0.3
            head = height - at * np.tan(np.radians(tilt)) - thick * 0.3
            parts.append(beam((side * x, 0, z * depth * 0.42), (side * x, float(head), at), bar, bar, "leg"))
        parts.append(box((bar, bar, depth * 0.8), (side * x, low * 0.2, 0), "support"))
    parts.append(box((2 * x, 0.06, 0.025), (0, low * 0.2, 0), "stretcher"))
    return parts


def counter_desk(rng: np.random.Generator) -> list[Part]:
    """Build a reception desk: a bowed panel at the back carries a bowed top; the sitter's side (+z) is open."""
    width, height, thick = between(rng, 1.3, 2.2), between(rng, 0.72, 1.05), between(rng, 0.02, 0.05)
    depth, head = width * between(rng, 0.3, 0.42), height - thick
    rim = superellipse(width, 2 * depth, between(rng, 2.0, 3.5), 40)[[*range(20, 40), 0]]
    # A crescent has room for the knees; a half moon is closed straight.
    inner = rim[::-1] * np.array([0.55, 0.4]) if happens(rng, 0.5) else np.zeros((0, 2))
    wall = rim * 0.95
    parts = [
        slab(np.concatenate([rim, inner]), head, thick, "top"),
        slab(np.concatenate([wall, wall[::-1] * np.array([0.95, 0.93])]), 0.0, head, "panel"),
    ]
    if happens(rng, 0.4):
        rise = between(rng, 0.15, 0.3)
        high = rim * 0.99
        shell = np.concatenate([high, high[::-1] * np.array([0.93, 0.9])])
        parts.append(slab(shell, height - 0.001, rise, "screen"))
    return parts
