"""Families of sofas: straight, corner, with a chaise, chesterfield, on a bent plan, of blocks."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from kpred.synthetic.chair.arms import upholstered_sides
from kpred.synthetic.chair.legs import bracket_feet
from kpred.synthetic.chair.upholstered import sofa_three, sofa_two, standing_cushion, upholstery
from kpred.synthetic.chance import between, happens, whole
from kpred.synthetic.furnishings.framed_sofas import daybed, seat_row, slim, wooden
from kpred.synthetic.part import Number
from kpred.synthetic.parts import Part, box, cushion, cylinder, sweep
from kpred.synthetic.paths import arc

Family = Callable[[np.random.Generator], list[Part]]


def four_seats(rng: np.random.Generator) -> list[Part]:
    """Build a long sofa with four places."""
    return upholstery(rng, between(rng, 1.9, 2.5), 4, happens(rng, 0.9), (0.25, 0.45), (0.0, 12.0), True)


def one_cushion(rng: np.random.Generator) -> list[Part]:
    """Build a sofa with one long seat cushion and one back."""
    return upholstery(rng, between(rng, 1.2, 2.0), 1, happens(rng, 0.8), (0.25, 0.5), (0.0, 14.0), happens(rng, 0.5))


def corner(rng: np.random.Generator) -> list[Part]:
    """Build two straight sofas that meet in a corner, left or right."""
    long, short = between(rng, 2.0, 3.0), between(rng, 1.4, 2.4)
    deep, feet = between(rng, 0.75, 0.95), between(rng, 0.03, 0.14)
    base, seat = feet + between(rng, 0.12, 0.2), between(rng, 0.38, 0.46)
    top, thick = seat + between(rng, 0.25, 0.45), between(rng, 0.14, 0.24)
    arm = between(rng, 0.1, 0.25)
    left, back, front = -long / 2, -deep / 2, deep / 2
    low = (base - 0.01, seat)
    parts = [
        box((long, base - feet, deep), (0, (base + feet) / 2, 0), "seat_frame"),
        box(
            (deep, base - feet, short - deep),
            (left + deep / 2, (base + feet) / 2, front + (short - deep) / 2),
            "seat_frame",
        ),
        box((long, top - feet, thick), (0, (top + feet) / 2, back + thick / 2), "back_frame"),
        box(
            (thick, top - feet, short - thick),
            (left + thick / 2, (top + feet) / 2, back + thick + (short - thick) / 2),
            "back_frame",
        ),
        cushion(
            (arm, seat + between(rng, 0.1, 0.22) - feet, deep),
            (long / 2 + arm / 2, (seat + 0.15 + feet) / 2, 0),
            "arm",
            0.04,
            3,
        ),
    ]
    parts += seat_row(rng, (left + deep, long / 2), whole(rng, 2, 3), (back + thick, front + 0.02), low)
    parts += seat_row(rng, (left + thick, left + deep), 1, (back + thick, front), low)
    parts += seat_row(rng, (left + thick, left + deep + 0.02), 1, (front, back + short), low)
    if happens(rng, 0.7):
        for k in range(3):
            x = left + deep + (long - deep) * (k + 0.5) / 3
            size = ((long - deep) / 3 - 0.01, top - seat + 0.06, 0.14)
            parts.append(standing_cushion(size, (x, seat - 0.02, back + thick + 0.06), 12, "back_cushion", 0.05))
    for x, z in (
        (left, back),
        (left, back + short - 0.08),
        (left + deep - 0.08, back + short - 0.08),
        (long / 2 - 0.08, back),
        (long / 2 - 0.08, front - 0.08),
    ):
        parts.append(box((0.07, feet + 0.01, 0.07), (x + 0.04, feet / 2, z + 0.04), "leg"))
    return [part.mirrored_x() for part in parts] if happens(rng, 0.5) else parts


def with_chaise(rng: np.random.Generator) -> list[Part]:
    """Build a straight sofa whose last seat reaches out as a chaise."""
    parts = upholstery(rng, between(rng, 1.6, 2.1), 3, True, (0.25, 0.45), (0.0, 12.0), True)
    seats = [part for part in parts if part.label == "seat_cushion"]
    low, high = seats[-1].vertices.min(axis=0), seats[-1].vertices.max(axis=0)
    out = between(rng, 0.45, 0.8)
    size = (high[0] - low[0], high[1] - low[1], out)
    place = ((low[0] + high[0]) / 2, (low[1] + high[1]) / 2, high[2] + out / 2 - 0.01)
    feet = between(rng, 0.02, 0.1)
    base = (size[0], low[1] - feet + 0.01, out)
    parts += [
        cushion(size, place, "seat_cushion", 0.03, 3),
        box(base, (place[0], (low[1] + feet) / 2, place[2] - 0.02), "seat_frame"),
        box((0.06, feet + 0.01, 0.06), (place[0], feet / 2, place[2] + out / 2 - 0.1), "leg"),
    ]
    return [part.mirrored_x() for part in parts] if happens(rng, 0.5) else parts


def chesterfield(rng: np.random.Generator) -> list[Part]:
    """Build a low sofa whose back and arms are one rolled wall of equal height."""
    width, depth = between(rng, 1.3, 2.1), between(rng, 0.7, 0.9)
    feet, seat = between(rng, 0.05, 0.14), between(rng, 0.4, 0.46)
    top, wall, roll = seat + between(rng, 0.22, 0.36), between(rng, 0.1, 0.18), between(rng, 0.08, 0.13)
    base = seat - between(rng, 0.1, 0.16)
    parts = [
        box((width, base - feet, depth), (0, (base + feet) / 2, 0), "seat_frame"),
        *seat_row(rng, (-width / 2, width / 2), whole(rng, 1, 3), (-depth / 2 + wall, depth / 2), (base, seat)),
        box((width, top - roll - feet, wall), (0, (top - roll + feet) / 2, -depth / 2 + wall / 2), "back_frame"),
        cylinder(
            roll,
            (-width / 2 - wall, top - roll, -depth / 2 + wall / 2),
            (width / 2 + wall, top - roll, -depth / 2 + wall / 2),
            "back_cushion",
            14,
        ),
    ]
    for side in (-1, 1):
        x = side * (width + wall) / 2
        parts.append(box((wall, top - roll - feet, depth), (x, (top - roll + feet) / 2, 0), "arm"))
        parts.append(cylinder(roll, (x, top - roll, -depth / 2), (x, top - roll, depth / 2 + 0.01), "arm", 14))
    return parts + bracket_feet(width + wall, depth, feet + 0.004, rng)


def curved(rng: np.random.Generator) -> list[Part]:
    """Build a sofa on a bent plan with a wall that runs around its back."""
    radius, wide = between(rng, 1.2, 1.8), between(rng, 65, 100)
    seat, feet, deep = between(rng, 0.38, 0.45), between(rng, 0.02, 0.1), between(rng, 0.5, 0.65)
    rise, wall = between(rng, 0.3, 0.45), between(rng, 0.12, 0.2)
    path = arc((0, 0, radius), radius, radius, -90 - wide / 2, -90 + wide / 2, 14)
    inner = arc(
        (0, 0, radius), radius - deep / 2 - wall / 2, radius - deep / 2 - wall / 2, -90 - wide / 2, -90 + wide / 2, 14
    )

    def rectangle(across: Number, low: Number, high: Number) -> np.ndarray:
        return np.array([[-across / 2, low], [across / 2, low], [across / 2, high], [-across / 2, high]])

    parts = [
        sweep(rectangle(deep, feet, seat - 0.14), inner, "seat_frame"),
        sweep(rectangle(deep + 0.02, seat - 0.14, seat), inner, "seat_cushion"),
        sweep(rectangle(wall, feet, seat + rise), path, "back_cushion"),
    ]
    for end in (inner[1], inner[-2], path[1], path[-2]):
        parts.append(cylinder(0.025, end * (1, 0, 1), end * (1, 0, 1) + (0, feet + 0.01, 0), "leg", 8))
    return parts


def padded_bench_sofa(rng: np.random.Generator) -> list[Part]:
    """Build a hard-edged sofa: blocks for base, back and arms."""
    width, depth = between(rng, 1.2, 2.3), between(rng, 0.7, 1.0)
    feet, seat = between(rng, 0.0, 0.1), between(rng, 0.36, 0.45)
    rise, thick, side = between(rng, 0.2, 0.4), between(rng, 0.15, 0.3), between(rng, 0.12, 0.3)
    parts = [
        box((width, seat - feet, depth), (0, (seat + feet) / 2, 0), "seat_cushion"),
        box((width, seat + rise - feet, thick), (0, (seat + rise + feet) / 2, -(depth - thick) / 2), "back_cushion"),
    ]
    if feet > 0.01:
        parts.append(box((width * 0.95, feet + 0.004, depth * 0.9), (0, feet / 2, 0), "plinth"))
    return parts + upholstered_sides(rng, width, depth, feet, seat + rise * between(rng, 0.4, 1.0), side)


SOFA_FAMILIES: dict[str, Family] = {
    "sofa_two_seats": sofa_two,
    "sofa_three_seats": sofa_three,
    "sofa_four_seats": four_seats,
    "one_cushion": one_cushion,
    "corner_sofa": corner,
    "sofa_with_chaise": with_chaise,
    "chesterfield": chesterfield,
    "slim_sofa": slim,
    "wooden_sofa": wooden,
    "daybed": daybed,
    "curved_sofa": curved,
    "block_sofa": padded_bench_sofa,
}
