"""Families of sofas with a visible frame: on thin legs, of wood, daybeds; and what sofas are made of."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from kpred.synthetic.chair.upholstered import standing_cushion
from kpred.synthetic.chance import between, happens, pick, whole
from kpred.synthetic.part import Number
from kpred.synthetic.parts import Part, beam, box, cushion, cylinder, frustum

Family = Callable[[np.random.Generator], list[Part]]


def short_legs(
    width: Number, depth: Number, height: Number, foot: Number, head: Number, splay: Number = 0.0
) -> list[Part]:
    """Build tapered legs at the corners of a rectangle, from the floor to `height`."""
    return [
        frustum(
            (foot, foot),
            (head, head),
            (a * (width / 2 + splay), 0, b * depth / 2),
            (a * width / 2, height, b * depth / 2),
            "leg",
        )
        for a in (-1, 1)
        for b in (-1, 1)
    ]


def seat_row(
    rng: np.random.Generator,
    span: tuple[Number, Number],
    count: int,
    rows: tuple[Number, Number],
    height: tuple[Number, Number],
) -> list[Part]:
    """Build cushions side by side: x from span[0] to span[1], z between `rows`, y between `height`."""
    soft, each = between(rng, 0.02, 0.05), (span[1] - span[0]) / count
    size = (each - 0.006, height[1] - height[0], rows[1] - rows[0])
    middle = (sum(height) / 2, sum(rows) / 2)
    return [cushion(size, (span[0] + each * (k + 0.5), *middle), "seat_cushion", soft, 3) for k in range(count)]


def slim(rng: np.random.Generator) -> list[Part]:
    """Build a sofa on thin legs with a thin shell and loose cushions."""
    width, depth = between(rng, 1.3, 2.2), between(rng, 0.7, 0.85)
    legs, board = between(rng, 0.12, 0.24), between(rng, 0.04, 0.1)
    seat, count = legs + board + between(rng, 0.1, 0.18), whole(rng, 2, 3)
    top, arm, tilt = seat + between(rng, 0.28, 0.42), between(rng, 0.03, 0.09), between(rng, 4, 14)
    parts = [
        box((width, board, depth), (0, legs + board / 2, 0), "seat_frame"),
        *short_legs(width - 0.12, depth - 0.1, legs + 0.01, 0.025, 0.045, between(rng, 0, 0.06)),
        *seat_row(
            rng, (-width / 2 + arm, width / 2 - arm), count, (-depth / 2 + 0.14, depth / 2 + 0.01), (legs + board, seat)
        ),
        standing_cushion(
            (width, top - legs - board, 0.06), (0, legs + board, -depth / 2 + 0.06), tilt, "back_frame", 0.02
        ),
    ]
    each = (width - 2 * arm) / count
    for k in range(count):
        x = -width / 2 + arm + each * (k + 0.5)
        parts.append(
            standing_cushion(
                (each - 0.01, top - seat + 0.04, 0.14),
                (x, seat - 0.02, -depth / 2 + 0.13),
                tilt + 3,
                "back_cushion",
                0.05,
            )
        )
    if happens(rng, 0.8):
        high = seat + between(rng, 0.08, 0.24)
        for side in (-1, 1):
            parts.append(
                box(
                    (arm, high - legs, depth * between(rng, 0.8, 1.0)),
                    (side * (width - arm) / 2, (high + legs) / 2, 0),
                    "arm",
                )
            )
    return parts


def wooden(rng: np.random.Generator) -> list[Part]:
    """Build a frame of wood with slats, seat and back cushions."""
    width, depth = between(rng, 1.2, 2.0), between(rng, 0.7, 0.9)
    seat, rise, bar = between(rng, 0.28, 0.36), between(rng, 0.4, 0.55), between(rng, 0.04, 0.07)
    arm_top, tilt, count = seat + between(rng, 0.2, 0.32), between(rng, 8, 18), whole(rng, 1, 3)
    parts = [box((width, bar, bar), (0, seat - bar / 2, z * (depth - bar) / 2), "rail") for z in (-1, 1)]
    for side in (-1, 1):
        x = side * (width + bar) / 2
        for z in (-1, 1):
            parts.append(beam((x, 0, z * (depth - bar) / 2), (x, arm_top, z * (depth - bar) / 2), bar, bar, "leg"))
        parts.append(box((bar, bar, depth), (x, seat - bar / 2, 0), "rail"))
        parts.append(box((bar * between(rng, 1.2, 2.0), 0.03, depth + 0.04), (x, arm_top + 0.015, 0), "arm"))
        for k in range(pick(rng, (0, 3, 5))):
            along = (k + 1) / 6 * depth - depth / 2
            parts.append(box((0.02, arm_top - seat, 0.03), (x, (arm_top + seat) / 2, along), "slat"))
    slats = whole(rng, 6, 12)
    for k in range(slats):
        x = ((k + 0.5) / slats - 0.5) * width
        slat = box((0.035, rise + 0.1, 0.02), (x, (rise + 0.1) / 2, 0), "slat").rotated("x", -tilt)
        parts.append(slat.moved((0, seat - bar, -depth / 2 + bar)))
    top = box((width, 0.06, 0.035), (0, rise + 0.1, 0), "rail").rotated("x", -tilt)
    parts.append(top.moved((0, seat - bar, -depth / 2 + bar)))
    pad = between(rng, 0.1, 0.16)
    parts += seat_row(rng, (-width / 2, width / 2), count, (-depth / 2 + bar + 0.06, depth / 2), (seat, seat + pad))
    for k in range(count):
        x = ((k + 0.5) / count - 0.5) * width
        parts.append(
            standing_cushion(
                (width / count - 0.01, rise, 0.13),
                (x, seat + pad / 2, -depth / 2 + bar + 0.06),
                tilt,
                "back_cushion",
                0.04,
            )
        )
    return parts


def daybed(rng: np.random.Generator) -> list[Part]:
    """Build a mattress on legs with bolsters or end boards, and perhaps a back rail."""
    width, depth = between(rng, 1.7, 2.1), between(rng, 0.75, 1.0)
    legs, pad, end = between(rng, 0.15, 0.3), between(rng, 0.12, 0.22), between(rng, 0.2, 0.45)
    top = legs + 0.06 + pad
    parts = [
        box((width, 0.06, depth), (0, legs + 0.03, 0), "seat_frame"),
        cushion((width - 0.02, pad, depth - 0.02), (0, legs + 0.06 + pad / 2, 0), "seat_cushion", 0.04, 3),
        *short_legs(width - 0.1, depth - 0.1, legs + 0.01, 0.04, 0.05),
    ]
    for side in (-1, 1):
        if happens(rng, 0.5):
            parts.append(box((0.04, top + end, depth), (side * width / 2, (top + end) / 2, 0), "end_board"))
        else:
            parts.append(
                cylinder(
                    0.11,
                    (side * (width / 2 - 0.13), top + 0.1, -depth / 2 + 0.03),
                    (side * (width / 2 - 0.13), top + 0.1, depth / 2 - 0.03),
                    "bolster",
                    14,
                )
            )
    if happens(rng, 0.6):
        parts.append(box((width, top + end * 0.9, 0.04), (0, (top + end * 0.9) / 2, -depth / 2), "back_frame"))
    for x in (-0.3, 0.0, 0.3) if happens(rng, 0.5) else ():
        parts.append(
            standing_cushion((0.5, 0.4, 0.14), (x * width, top - 0.01, -depth / 2 + 0.12), 14, "back_cushion", 0.05)
        )
    return parts
