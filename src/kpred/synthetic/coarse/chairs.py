"""Chairs of few plain boxes: a seat, a back and what carries them, in wide proportions.

Frame: metres, y up, floor y = 0, the back at -z.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from kpred.synthetic.chance import between, happens, pick, whole
from kpred.synthetic.coarse.chair_parts import apron, corner_posts, plain_arms, plain_back, stretchers
from kpred.synthetic.parts import Part, beam, box

Family = Callable[[np.random.Generator], list[Part]]


def plain_chair(rng: np.random.Generator) -> list[Part]:
    """Build a seat board on four legs and a back: low to high, narrow to wide, thin to stout."""
    width = between(rng, 0.36, 0.7)
    depth, seat = width * between(rng, 0.75, 1.2), between(rng, 0.28, 0.52)
    thick = seat * pick(rng, (between(rng, 0.05, 0.15), between(rng, 0.12, 0.4)))
    size = width * pick(rng, (between(rng, 0.05, 0.1), between(rng, 0.09, 0.26)))
    head, rise = seat - thick, between(rng, 0.25, 0.85)
    parts = [box((width, thick, depth), (0, seat - thick / 2, 0), "seat")]
    wide, deep = width * between(rng, 0.85, 1.0), depth * between(rng, 0.85, 1.0)
    barred = size < 0.1 * width and happens(rng, 0.35)
    parts += corner_posts(rng, wide, deep, head, size, straight=barred)
    parts += stretchers(rng, wide, deep, head, size) if barred else []
    return (
        parts
        + apron(rng, width, depth, head)
        + plain_back(rng, width, depth, seat, rise)
        + plain_arms(rng, width, depth, seat)
    )


def high_chair(rng: np.random.Generator) -> list[Part]:
    """Build a high seat with a low back or a small one, as at a bar."""
    width = between(rng, 0.32, 0.5)
    depth, seat = width * between(rng, 0.85, 1.15), between(rng, 0.58, 0.85)
    thick, size = between(rng, 0.02, 0.14), between(rng, 0.02, 0.07)
    head = seat - thick
    parts = [box((width, thick, depth), (0, seat - thick / 2, 0), "seat")]
    parts += corner_posts(rng, width * 0.96, depth * 0.96, head, size, straight=True)
    y = head * between(rng, 0.2, 0.5)
    x, z = (width * 0.96 - size) / 2, (depth * 0.96 - size) / 2
    parts += [box((size * 0.7, size * 0.7, 2 * z), (s * x, y, 0), "stretcher") for s in (-1, 1)]
    parts += [box((2 * x, size * 0.7, size * 0.7), (0, y, s * z), "stretcher") for s in (-1, 1)]
    return (
        parts + plain_back(rng, width, depth, seat, between(rng, 0.12, 0.5)) + plain_arms(rng, width, depth, seat, 0.15)
    )


def block_chair(rng: np.random.Generator) -> list[Part]:
    """Build a block as a seat, on the floor or short feet, with a back of any height."""
    width, seat = between(rng, 0.45, 1.0), between(rng, 0.26, 0.5)
    depth = width * between(rng, 0.75, 1.3) if width < 0.75 else width * between(rng, 0.7, 1.0)
    feet = seat * pick(rng, (0.0, between(rng, 0.05, 0.35)))
    parts = [box((width, seat - feet, depth), (0, (seat + feet) / 2, 0), "seat")]
    if feet:
        parts += corner_posts(rng, width, depth, feet, width * between(rng, 0.05, 0.2))
    rise, thick = between(rng, 0.15, 0.7), depth * between(rng, 0.1, 0.4)
    low = pick(rng, (seat - 0.01, feet, 0.0))
    back = box((width, seat + rise - low, thick), (0, (low + seat + rise) / 2, -(depth - thick) / 2), "back_panel")
    if low == 0.0:
        back = back.moved((0, 0, -thick * between(rng, 0.0, 0.98)))
    elif happens(rng, 0.5):
        back = back.rotated("x", -between(rng, 0, 18), (0, seat, -depth / 2 + thick))
    parts.append(back)
    if happens(rng, 0.3):
        tall = rise * between(rng, 0.3, 0.9)
        pad = depth * between(rng, 0.08, 0.2)
        parts.append(
            box((width * 0.9, tall, pad), (0, seat + tall / 2 - 0.005, -depth / 2 + thick + pad / 2), "back_cushion")
        )
    if happens(rng, 0.6):
        wide, tall = width * between(rng, 0.06, 0.28), min(between(rng, 0.08, 0.35), rise)
        foot = pick(rng, (0.0, feet, seat - 0.02))
        long = depth * pick(rng, (1.0, between(rng, 0.7, 1.05)))
        size, y = (wide, seat + tall - foot, long), (foot + seat + tall) / 2
        parts += [box(size, (s * (width + wide) / 2 - s * 0.006, y, -(depth - long) / 2), "arm") for s in (-1, 1)]
    return parts


def walled_chair(rng: np.random.Generator) -> list[Part]:
    """Build walls round three sides of a seat, of equal or different heights, on the floor, feet, or a column."""
    width, depth = between(rng, 0.45, 0.95), between(rng, 0.45, 0.85)
    wall = between(rng, 0.03, 0.2) * width
    lift = pick(rng, (0.0, between(rng, 0.05, 0.2), between(rng, 0.15, 0.3)))
    seat = lift + between(rng, 0.12, 0.35)
    top = seat + between(rng, 0.25, 0.9)
    arm = pick(rng, (top, seat + (top - seat) * between(rng, 0.3, 0.8)))
    inner = width - 2 * wall
    low = pick(rng, (lift, lift, seat - 0.12)) if lift == 0 else lift
    parts = [
        box((inner + 0.006, seat - lift, depth - wall + 0.006), (0, (seat + lift) / 2, wall / 2 - 0.003), "seat"),
        box((width, top - low, wall), (0, (top + low) / 2, -(depth - wall) / 2), "back_panel"),
    ]
    long = depth * pick(rng, (1.0, between(rng, 0.6, 1.0)))
    x, z = (width - wall) / 2, -(depth - long) / 2
    parts += [box((wall, arm - low, long), (s * x, (arm + low) / 2, z), "arm") for s in (-1, 1)]
    if lift > 0.14 and happens(rng, 0.5):
        return parts + _column(rng, width, lift)
    return parts + (corner_posts(rng, inner, depth * 0.96, lift, between(rng, 0.03, 0.1)) if lift else [])


def _column(rng: np.random.Generator, width: float, head: float) -> list[Part]:
    """Build a column on a plate or on a cross of bars."""
    wide = width * pick(rng, (between(rng, 0.08, 0.2), between(rng, 0.15, 0.5)))
    foot, reach = head * between(rng, 0.05, 0.25), width * between(rng, 0.6, 1.1)
    parts = [box((wide, head + 0.004, wide), (0, head / 2 + 0.002, 0), "column")]
    if happens(rng, 0.5):
        return [*parts, box((reach, foot, reach), (0, foot / 2, 0), "foot")]
    bars = whole(rng, 2, 3)
    turn = between(rng, 0, 90)
    bar = max(0.03, 0.3 * wide)
    return parts + [
        box((reach, foot, bar), (0, foot / 2, 0), "foot").rotated("y", turn + 180 * k / bars) for k in range(bars)
    ]


def column_chair(rng: np.random.Generator) -> list[Part]:
    """Build a seat and back on a column with a plate or bars: swivel chairs, bar stools with a back."""
    width = between(rng, 0.38, 0.65)
    depth, thick = width * between(rng, 0.8, 1.15), between(rng, 0.03, 0.2)
    seat = thick + between(rng, 0.18, 0.42) if happens(rng, 0.75) else between(rng, 0.55, 0.8)
    parts = [box((width, thick, depth), (0, seat - thick / 2, 0), "seat")]
    parts += _column(rng, width, seat - thick)
    return parts + plain_back(rng, width, depth, seat, between(rng, 0.2, 0.75)) + plain_arms(rng, width, depth, seat)


def slab_throne(rng: np.random.Generator) -> list[Part]:
    """Build a panel far above the seat, the seat a block or held by panels or front legs."""
    width, seat = between(rng, 0.38, 0.75), between(rng, 0.3, 0.52)
    depth, top = width * between(rng, 0.7, 1.2), seat + between(rng, 0.3, 0.95)
    thick = depth * between(rng, 0.04, 0.2)
    lift = pick(rng, (0.0, 0.0, between(rng, 0.05, 0.25)))
    parts = [box((width, top - lift, thick), (0, (top + lift) / 2, -(depth - thick) / 2), "back_panel")]
    kind = pick(rng, ("block", "sides", "legs"))
    tall = (seat - 0.004) if kind == "block" else seat * between(rng, 0.06, 0.3)
    parts.append(box((width, tall, depth), (0, seat - tall / 2, 0), "seat"))
    head = seat - tall
    if kind == "sides":
        board = between(rng, 0.015, 0.08)
        up = head + 0.004 if happens(rng, 0.5) else seat + between(rng, 0.1, 0.3)
        parts += [box((board, up, depth), (s * (width - board) / 2, up / 2, 0), "side") for s in (-1, 1)]
    elif kind == "legs":
        parts += corner_posts(rng, width, depth, head, between(rng, 0.03, 0.1))
    elif lift:
        parts += plain_arms(rng, width, depth, seat, 0.5)
    return parts


def bent_chair(rng: np.random.Generator) -> list[Part]:
    """Build a seat, lean back and runners, side frames or a bent support: cantilevers, loungers, deck chairs."""
    width = between(rng, 0.42, 0.75)
    depth, seat = width * between(rng, 0.8, 1.4), between(rng, 0.25, 0.46)
    thick, bar = between(rng, 0.02, 0.14), between(rng, 0.02, 0.06)
    head = seat - thick
    parts = [box((width, thick, depth), (0, seat - thick / 2, 0), "seat")]
    x, z = width / 2 - bar / 2, depth / 2 - bar / 2
    kind = pick(rng, ("cantilever", "frame", "cross"))
    for s in (-1, 1):
        if kind == "cross":
            parts += [beam((s * x, 0, b * z), (s * x, head + 0.01, -b * z), bar, bar, "leg") for b in (-1, 1)]
            continue
        parts.append(box((bar, bar, depth), (s * x, bar / 2, 0), "runner"))
        for b in (1,) if kind == "cantilever" else (-1, 1):
            parts.append(box((bar, head + 0.002, bar), (s * x, head / 2, b * z), "leg"))
    if happens(rng, 0.6) and kind != "cross":
        parts.append(box((width, bar, bar), (0, bar / 2, -z), "runner"))
    return parts + plain_back(rng, width, depth, seat, between(rng, 0.3, 0.7)) + plain_arms(rng, width, depth, seat)


COARSE_CHAIRS: dict[str, Family] = {
    "plain_chair": plain_chair,
    "high_chair": high_chair,
    "block_chair": block_chair,
    "walled_chair": walled_chair,
    "column_chair": column_chair,
    "slab_throne": slab_throne,
    "bent_chair": bent_chair,
}
