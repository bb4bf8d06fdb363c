"""Families of benches: hard seats for several, with and without a back."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from kpred.synthetic.chance import between, happens, whole
from kpred.synthetic.parts import Part, beam, box, cushion, cylinder, ellipse, slab
from kpred.synthetic.table.legs import any_leg_style, four_legs

Family = Callable[[np.random.Generator], list[Part]]


def plain_bench(rng: np.random.Generator) -> list[Part]:
    """Build a long seat on four legs or on boards."""
    width, depth, top, thick = (
        between(rng, 0.9, 2.0),
        between(rng, 0.28, 0.45),
        between(rng, 0.4, 0.5),
        between(rng, 0.025, 0.06),
    )
    parts = [box((width, thick, depth), (0, top - thick / 2, 0), "seat")]
    if happens(rng, 0.55):
        parts += four_legs(
            rng,
            width - between(rng, 0.02, 0.3),
            depth - 0.02,
            top - thick,
            any_leg_style(rng, top, ("square", "tapered", "round", "hairpin", "turned")),
            between(rng, 0.0, 0.07),
            happens(rng, 0.3),
        )
    else:
        inset = between(rng, 0.0, 0.25)
        parts += [
            box(
                (between(rng, 0.03, 0.05), top - thick, 0.9 * depth),
                (s * (width / 2 - 0.03 - inset), (top - thick) / 2, 0),
                "side",
            )
            for s in (-1, 1)
        ]
        parts.append(
            box((width - 2 * inset - 0.06, 0.09, 0.03), (0, top - thick - between(rng, 0.05, 0.2), 0), "stretcher")
        )
    if happens(rng, 0.3):
        parts.append(cushion((width - 0.02, 0.06, depth - 0.02), (0, top + 0.03, 0), "seat_cushion", 0.02, 2))
    return parts


def back_bench(rng: np.random.Generator) -> list[Part]:
    """Build a garden bench with a slatted back, seat slats and arms."""
    width, depth, seat, back = (
        between(rng, 1.0, 1.9),
        between(rng, 0.42, 0.58),
        between(rng, 0.4, 0.46),
        between(rng, 0.36, 0.52),
    )
    post, tilt, upright = between(rng, 0.045, 0.07), between(rng, 3, 16), happens(rng, 0.5)
    count = whole(rng, 4, 7)
    parts = [
        box((width, 0.022, depth / count - 0.012), (0, seat, ((k + 0.5) / count - 0.5) * depth), "slat")
        for k in range(count)
    ]
    rear = []
    frames = (-1, 1) if width < 1.5 or happens(rng, 0.5) else (-1, 0, 1)
    for s in frames:
        x = s * (width / 2 - post / 2)
        rear.append(beam((x, 0, 0), (x, back, 0), post, post * 0.8, "back_post"))
        parts.append(beam((x, 0, -depth / 2), (x, seat, -depth / 2), post, post, "leg"))
        high = seat + between(rng, 0.18, 0.24) if s else seat
        parts.append(beam((x, 0, depth / 2 - post), (x, high, depth / 2 - post), post, post, "leg"))
        parts.append(box((post * 0.7, 0.05, depth), (x, seat - 0.035, 0), "rail"))
        if s:
            parts.append(box((post, 0.03, depth + 0.02), (x, high + 0.015, 0.01), "arm"))
    if upright:
        bars = whole(rng, 8, 18)
        rear += [
            box((0.04, back - 0.12, 0.018), (((k + 0.5) / bars - 0.5) * (width - 2 * post), back / 2, 0), "slat")
            for k in range(bars)
        ]
        rear += [box((width - post, 0.06, 0.03), (0, y, 0), "rail") for y in (0.05, back - 0.03)]
    else:
        rear += [
            box((width, 0.07, 0.022), (0, back * f, post / 2), "slat")
            for f in np.linspace(0.25, 0.93, whole(rng, 2, 5))
        ]
    return parts + [part.rotated("x", -tilt).moved((0, seat, -depth / 2)) for part in rear]


def settle(rng: np.random.Generator) -> list[Part]:
    """Build a bench with a closed body, a panelled back and sides."""
    width, depth, seat, top = (
        between(rng, 0.9, 1.6),
        between(rng, 0.4, 0.55),
        between(rng, 0.42, 0.48),
        between(rng, 0.8, 1.3),
    )
    parts = [
        box((width, seat, depth), (0, seat / 2, 0), "body"),
        box((width, top - seat, 0.03), (0, (top + seat) / 2, -depth / 2 + 0.015), "back"),
    ]
    parts.append(box((width + 0.01, 0.025, depth + 0.01), (0, seat, 0.01), "lid"))
    if happens(rng, 0.7):
        high = seat + between(rng, 0.15, 0.3)
        parts += [box((0.03, high, depth), (s * (width / 2 + 0.015), high / 2, 0), "arm") for s in (-1, 1)]
    return parts


def padded_bench(rng: np.random.Generator) -> list[Part]:
    """Build an upholstered bench on legs, as at the foot of a bed, perhaps with rolled ends."""
    width, depth, top, pad = (
        between(rng, 0.8, 1.5),
        between(rng, 0.36, 0.5),
        between(rng, 0.42, 0.52),
        between(rng, 0.08, 0.18),
    )
    parts = [cushion((width, pad, depth), (0, top - pad / 2, 0), "seat", 0.03, 3)]
    parts += four_legs(
        rng,
        width - 0.06,
        depth - 0.06,
        top - pad + 0.01,
        any_leg_style(rng, top, ("tapered", "turned", "round", "cabriole")),
        0.0,
    )
    if happens(rng, 0.4):
        parts += [
            cylinder(
                0.07,
                (s * (width / 2 - 0.05), top + 0.05, -depth / 2),
                (s * (width / 2 - 0.05), top + 0.05, depth / 2),
                "arm",
                14,
            )
            for s in (-1, 1)
        ]
    return parts


def picnic(rng: np.random.Generator) -> list[Part]:
    """Build a bench of half a log, or of thick blocks."""
    width, top = between(rng, 0.9, 1.8), between(rng, 0.38, 0.48)
    if happens(rng, 0.5):
        parts = [slab(ellipse(0.34, 0.26, 16), 0, width, "seat").rotated("z", 90).moved((width / 2, top - 0.15, 0))]
        return parts + [
            cylinder(0.1, (s * 0.35 * width, 0, 0), (s * 0.35 * width, top - 0.18, 0), "leg", 12) for s in (-1, 1)
        ]
    parts = [box((width, 0.1, 0.42), (0, top - 0.05, 0), "seat")]
    return parts + [box((0.18, top - 0.1, 0.36), (s * 0.36 * width, (top - 0.1) / 2, 0), "block") for s in (-1, 1)]


BENCH_FAMILIES: dict[str, Family] = {
    "plain_bench": plain_bench,
    "back_bench": back_bench,
    "settle": settle,
    "padded_bench": padded_bench,
    "block_bench": picnic,
}
