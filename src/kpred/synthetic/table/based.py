"""Tables that stand on a base instead of separate legs: trestles, crossed legs, slabs, boxes, sleds."""

from __future__ import annotations

import numpy as np

from kpred.synthetic.cabinet.fronts import Opening, any_front_style, drawers
from kpred.synthetic.chance import between, happens, pick, whole
from kpred.synthetic.parts import Part, beam, box, cylinder, frustum
from kpred.synthetic.table.tops import any_top_shape, leg_reach, tabletop


def _x_frame(x: float, head: float, span: float, wide: float, deep: float) -> list[Part]:
    return [
        beam(
            (x + side * wide * 0.02, 0, -side * span / 2),
            (x + side * wide * 0.02, head, side * span / 2),
            wide,
            deep,
            "leg",
        )
        for side in (-1, 1)
    ]


def trestle_table(rng: np.random.Generator) -> list[Part]:
    """Build two end frames (I, X, A, V, or block) and a long stretcher under the top."""
    width = between(rng, 1.2, 2.6)
    depth = float(np.clip(width / between(rng, 1.5, 3.0), 0.6, 1.1))
    height, thick = between(rng, 0.7, 0.8), between(rng, 0.025, 0.07)
    if happens(rng, 0.2):
        width, depth, height = width * 0.55, depth * 0.75, between(rng, 0.38, 0.5)
    head = height - thick
    shape = any_top_shape(rng, 0.15)
    parts, reach = tabletop(rng, width, depth, height, thick, shape), leg_reach(shape)
    x, span, bar = (
        reach * width / 2 * between(rng, 0.55, 0.85),
        reach * depth * between(rng, 0.6, 0.85),
        between(rng, 0.045, 0.09),
    )
    form = pick(rng, ("i", "x", "a", "v", "block", "twin"))
    for side in (-1, 1):
        at = side * x
        if form in ("i", "twin", "block"):
            wide = {"i": bar * 1.6, "twin": bar, "block": span * 0.5}[form]
            parts.append(box((bar, 0.07, span), (at, 0.035, 0), "foot"))
            parts.append(box((bar, 0.06, span * 0.9), (at, head - 0.03, 0), "support"))
            for z in (-span * 0.18, span * 0.18) if form == "twin" else (0.0,):
                parts.append(box((bar * 0.9, head - 0.1, wide), (at, head / 2, z), "leg"))
        elif form == "x":
            parts += _x_frame(at, head, span, bar, bar)
        else:
            low, high = (span / 2, span * 0.12) if form == "a" else (span * 0.12, span / 2)
            parts += [beam((at, 0, z * low), (at, head, z * high), bar, bar, "leg") for z in (-1, 1)]
            y = head * 0.3
            parts.append(box((bar * 0.6, bar, 2 * (low + (high - low) * 0.3)), (at, y, 0), "support"))
    if form != "a" and form != "v" or happens(rng, 0.5):
        y = head * {"x": 0.5, "a": 0.3, "v": 0.3}.get(form, between(rng, 0.2, 0.5))
        if form == "twin":
            parts.append(box((2 * x, 0.09, span * 0.36), (0, y, 0), "stretcher"))
        else:
            parts.append(box((2 * x, 0.09, 0.035), (0, y, 0), "stretcher"))
    return parts


def x_leg_table(rng: np.random.Generator) -> list[Part]:
    """Build legs that cross along the width, as in butlers' tables and sawhorse desks."""
    width = between(rng, 0.5, 1.6)
    depth = float(np.clip(width / between(rng, 1.0, 2.6), 0.38, 0.85))
    height, thick, bar = between(rng, 0.4, 0.95), between(rng, 0.015, 0.045), between(rng, 0.025, 0.05)
    head = height - thick
    shape = any_top_shape(rng, 0.1)
    parts, reach = tabletop(rng, width, depth, height, thick, shape), leg_reach(shape)
    span, z = reach * width * between(rng, 0.65, 0.92), reach * depth / 2 * between(rng, 0.7, 0.95) - bar / 2
    for side in (-1, 1):
        # The two bars of a cross lie side by side, as they do round a bolt.
        for slope in (-1, 1):
            at = side * z + slope * bar * 0.25
            parts.append(beam((-slope * span / 2, 0, at), (slope * span / 2, head, at), bar * 0.55, bar * 1.3, "leg"))
    parts.append(cylinder(bar * 0.4, (0, head / 2, -z), (0, head / 2, z), "stretcher", 10))
    for end in (-1, 1):
        parts.append(
            cylinder(bar * 0.35, (end * span / 2, bar * 0.4, -z), (end * span / 2, bar * 0.4, z), "stretcher", 10)
        )
    return parts


def slab_table(rng: np.random.Generator) -> list[Part]:
    """Build two standing slabs at the ends, flush with the top (waterfall) or set in."""
    width = between(rng, 0.5, 2.0)
    depth = float(np.clip(width / between(rng, 1.0, 3.0), 0.35, 1.0))
    height = pick(rng, (between(rng, 0.3, 0.5), between(rng, 0.68, 0.8)))
    thick = between(rng, 0.018, 0.08)
    inset = pick(rng, (0.0, 0.0, between(rng, 0.05, 0.15) * width))
    deep = depth * (1.0 if inset == 0 else between(rng, 0.75, 0.95))
    head = height - thick
    parts = [box((width, thick, depth), (0, height - thick / 2, 0), "top")]
    lean = between(rng, 0.0, 0.12) * height if happens(rng, 0.25) and inset > 0 else 0.0
    for side in (-1, 1):
        x = side * (width / 2 - inset - thick / 2)
        parts.append(frustum((thick, deep), (thick, deep), (x + side * lean, 0, 0), (x, head, 0), "side"))
    span = width - 2 * inset - thick
    if happens(rng, 0.45):
        y = head * between(rng, 0.15, 0.65)
        parts.append(box((span + 2 * lean * (1 - y / head), thick * 0.8, deep * 0.95), (0, y, 0), "shelf"))
    elif happens(rng, 0.4):
        tall = head * between(rng, 0.3, 0.9)
        parts.append(box((span + lean * tall / head, tall, 0.02), (0, head - tall / 2, -deep * 0.3), "panel"))
    if inset == 0 and head > 0.6 and happens(rng, 0.3):
        parts.append(box((span, 0.02, deep * 0.9), (0, head - 0.13, 0), "shelf"))
        front = Opening(-span / 2, span / 2, head - 0.13, head, 0.0, deep * 0.45, 0.02)
        parts += drawers(rng, front, any_front_style(rng), 1, whole(rng, 1, 3))
    return parts


def cube_table(rng: np.random.Generator) -> list[Part]:
    """Build a solid block, an open box, or a slatted box."""
    width = between(rng, 0.35, 0.9)
    depth, height, thick = width / between(rng, 1.0, 1.5), between(rng, 0.32, 0.6), between(rng, 0.02, 0.05)
    form = pick(rng, ("block", "open", "shelf", "slats", "taper"))
    parts = [box((width, thick, depth), (0, height - thick / 2, 0), "top")]
    head = height - thick
    if form == "block":
        shrink = pick(rng, (0.0, 0.04, 0.1))
        return parts + [box((width - shrink, head, depth - shrink), (0, head / 2, 0), "body")]
    if form == "taper":
        grow = between(rng, 0.6, 1.0)
        return parts + [
            frustum((width * 0.95, depth * 0.95), (width * grow, depth * grow), (0, 0, 0), (0, head, 0), "body")
        ]
    if form == "slats":
        count = whole(rng, 5, 9)
        for side in (-1, 1):
            for k in range(count):
                x = -width / 2 + width * (k + 0.5) / count
                parts.append(box((width / count * 0.6, head, 0.02), (x, head / 2, side * (depth / 2 - 0.02)), "slat"))
                z = -depth / 2 + depth * (k + 0.5) / count
                parts.append(box((0.02, head, depth / count * 0.6), (side * (width / 2 - 0.02), head / 2, z), "slat"))
        return parts + [box((width, 0.03, depth), (0, 0.015, 0), "bottom")]
    parts += [box((thick, head, depth), (side * (width - thick) / 2, head / 2, 0), "side") for side in (-1, 1)]
    parts.append(box((width - 2 * thick, thick, depth), (0, thick / 2, 0), "bottom"))
    if form == "shelf":
        parts.append(box((width - 2 * thick, thick, depth), (0, head * between(rng, 0.35, 0.65), 0), "shelf"))
    if happens(rng, 0.5):
        parts.append(
            box((width - 2 * thick, head - thick, 0.012), (0, head / 2 + thick / 2, -depth / 2 + 0.006), "back")
        )
    return parts


def sled_table(rng: np.random.Generator) -> list[Part]:
    """Build closed or open loops of bar at the two ends: runners on the floor, uprights, bars under the top."""
    width = between(rng, 0.6, 2.2)
    depth = float(np.clip(width / between(rng, 1.0, 2.8), 0.4, 1.0))
    height, thick = pick(rng, (between(rng, 0.35, 0.5), between(rng, 0.68, 0.78))), between(rng, 0.015, 0.05)
    head, wide, bar = height - thick, between(rng, 0.03, 0.1), between(rng, 0.015, 0.05)
    shape = any_top_shape(rng, 0.0)
    parts, reach = tabletop(rng, width, depth, height, thick, shape), leg_reach(shape)
    x, deep = reach * width / 2 * between(rng, 0.65, 0.95) - wide / 2, reach * depth * between(rng, 0.75, 0.95)
    foot = deep * pick(rng, (1.0, 1.0, between(rng, 0.5, 0.8)))
    for side in (-1, 1):
        parts.append(box((wide, bar, foot), (side * x, bar / 2, 0), "runner"))
        parts.append(box((wide, bar, deep), (side * x, head - bar / 2, 0), "support"))
        for z in (-1, 1):
            parts.append(
                frustum(
                    (wide, bar),
                    (wide, bar),
                    (side * x, 0, z * (foot - bar) / 2),
                    (side * x, head, z * (deep - bar) / 2),
                    "leg",
                )
            )
    if happens(rng, 0.4):
        parts.append(box((2 * x, bar, bar), (0, head - bar / 2, 0), "stretcher"))
    if happens(rng, 0.2):
        parts.append(box((2 * x, bar, foot * 0.9), (0, bar * 1.5, 0), "shelf"))
    return parts


def c_table(rng: np.random.Generator) -> list[Part]:
    """Build a side table open at one end: foot, one upright panel or two posts, top."""
    width, depth = between(rng, 0.4, 0.7), between(rng, 0.28, 0.45)
    height, thick = between(rng, 0.5, 0.7), between(rng, 0.015, 0.03)
    parts = [box((width, thick, depth), (0, height - thick / 2, 0), "top")]
    side = pick(rng, (-1, 1))
    long = width * between(rng, 0.75, 1.0)
    if happens(rng, 0.5):
        parts.append(box((thick, height, depth), (side * (width - thick) / 2, height / 2, 0), "side"))
        parts.append(box((long, thick, depth), (side * (width - long) / 2, thick / 2, 0), "foot"))
        return parts
    for z in (-1, 1):
        parts.append(
            box(
                (0.025, height - thick, 0.025),
                (side * (width / 2 - 0.0125), (height - thick) / 2, z * (depth / 2 - 0.02)),
                "leg",
            )
        )
        parts.append(box((long, 0.025, 0.025), (side * (width - long) / 2, 0.0125, z * (depth / 2 - 0.02)), "foot"))
    parts.append(box((0.025, 0.025, depth - 0.04), (side * (width / 2 - 0.0125), 0.0125, 0), "foot"))
    return parts
