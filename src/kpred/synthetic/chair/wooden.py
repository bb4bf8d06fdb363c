"""Families of chairs on legs: dining chairs, stools, benches, garden, folding and rocking chairs."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from kpred.synthetic.chair.arms import ARM_STYLES, arm_parts
from kpred.synthetic.chair.backs import Bend
from kpred.synthetic.chair.bases import crossed_legs, rocker_runners, side_panels, trestle_legs
from kpred.synthetic.chair.legs import (
    LEG_STYLES,
    STRETCHERS,
    Legs,
    apron_parts,
    corner_legs,
    leg_parts,
    stretcher_parts,
)
from kpred.synthetic.chair.seats import Seat, back_parts, random_bend, seat_parts, seat_size, some_back
from kpred.synthetic.chance import between, happens, pick
from kpred.synthetic.parts import Part, box, cylinder, ellipse, slab, sweep

Family = Callable[[np.random.Generator], list[Part]]


def legged_base(
    rng: np.random.Generator,
    seat: Seat,
    styles: tuple[str, ...] = LEG_STYLES,
    splay: float | None = None,
    stretchers: tuple[str, ...] = STRETCHERS,
    high: float = 0.6,
) -> tuple[list[Part], Legs]:
    """Build four legs, sometimes with an apron and stretchers, under a seat."""
    style = pick(rng, styles)
    thick = between(rng, 0.022, 0.055) if style != "hairpin" else 0.05
    if splay is None:
        splay = between(rng, 0.02, 0.07) if happens(rng, 0.35) else 0.0
    if style == "cabriole":
        splay = 0.0
    inset = between(rng, 0.0, 0.05) if happens(rng, 0.4) else 0.0
    rake = between(rng, 0.0, 0.07) if happens(rng, 0.5) else 0.0
    narrow = between(rng, 0.85, 1.0) if happens(rng, 0.5) else 1.0
    legs = corner_legs(rng, seat.width, seat.depth, seat.bottom + 0.004, thick, splay, rake, inset, narrow)
    parts = leg_parts(rng, legs, style)
    if style not in ("hairpin", "cabriole") and happens(rng, 0.4):
        parts += apron_parts(legs, between(rng, 0.03, 0.09), thick * between(rng, 0.4, 0.8))
    if style not in ("hairpin", "cabriole", "sabre"):
        parts += stretcher_parts(rng, legs, pick(rng, stretchers), 0.15, high)
    return parts, legs


def _dining(backs: tuple[str, ...], arms: float = 0.25) -> Family:
    def family(rng: np.random.Generator) -> list[Part]:
        seat = seat_size(rng)
        style = pick(
            rng,
            ("board", "rounded", "trapezoid", "cushion", "board_cushion", "slatted", "bent"),
            (3.0, 2.0, 2.0, 2.0, 1.0, 0.7, 0.7),
        )
        parts = seat_parts(rng, seat, style)
        base, _ = legged_base(rng, seat)
        width = seat.width * (between(rng, 0.8, 0.86) if style == "trapezoid" else between(rng, 0.84, 1.0))
        bend = random_bend(rng, width, between(rng, 0.28, 0.7))
        back, foot = back_parts(rng, seat, bend, some_back(rng, backs))
        if happens(rng, arms):
            # A seat that narrows to the back carries its arms further in.
            base += _arms(rng, replace(seat, width=seat.width * 0.88) if style == "trapezoid" else seat, foot, bend)
        return [*parts, *base, *back]

    return family


def _arms(
    rng: np.random.Generator, seat: Seat, foot: float, bend: Bend, styles: tuple[str, ...] = ARM_STYLES
) -> list[Part]:
    rise = min(between(rng, 0.16, 0.28), bend.height * 0.8)
    return arm_parts(rng, pick(rng, styles), seat.width, seat.depth, seat.top, seat.bottom, rise, foot, bend)


def armchair_wooden(rng: np.random.Generator) -> list[Part]:
    """Build a wide seat on legs with open armrests, loose cushions or not."""
    seat = seat_size(rng, (0.5, 0.72), (0.34, 0.46))
    parts = seat_parts(rng, seat, pick(rng, ("board", "rounded", "cushion", "board_cushion", "slatted")))
    base, _ = legged_base(rng, seat)
    bend = random_bend(rng, seat.width * between(rng, 0.88, 1.0), between(rng, 0.3, 0.65), (5.0, 22.0))
    back, foot = back_parts(rng, seat, bend, some_back(rng, ()))
    return [*parts, *base, *back, *_arms(rng, seat, foot, bend)]


def windsor(rng: np.random.Generator) -> list[Part]:
    """Round or rounded seat board, splayed round legs, spindles in a hoop or under a crest."""
    seat = seat_size(rng, (0.4, 0.52), (0.42, 0.47), (0.025, 0.05))
    parts = seat_parts(rng, seat, "rounded")
    splay = between(rng, 0.03, 0.08)
    base, _ = legged_base(rng, seat, ("round", "cone", "turned"), splay, ("h", "h", "ring", "sides"), 0.5)
    bend = random_bend(rng, seat.width * between(rng, 0.82, 0.95), between(rng, 0.35, 0.7), (6.0, 18.0))
    back, foot = back_parts(rng, seat, bend, pick(rng, ("hoop", "spindles")), between(rng, 0.018, 0.03), 0.015)
    arms = _arms(rng, seat, foot, bend, ("posts", "slatted")) if happens(rng, 0.3) else []
    return [*parts, *base, *back, *arms]


def throne(rng: np.random.Generator) -> list[Part]:
    """Build a very high back on a sturdy seat."""
    seat = seat_size(rng, (0.45, 0.7), (0.42, 0.52), (0.04, 0.14))
    parts = seat_parts(rng, seat, pick(rng, ("board", "cushion", "board_cushion")))
    base, _ = legged_base(rng, seat, ("square", "tapered", "turned", "cabriole"), 0.0)
    bend = random_bend(rng, seat.width * between(rng, 0.8, 1.0), between(rng, 0.75, 1.15), (0.0, 8.0))
    back, foot = back_parts(rng, seat, bend, some_back(rng, ()), between(rng, 0.025, 0.06))
    arms = _arms(rng, seat, foot, bend, ("posts", "panel", "slatted", "frame")) if happens(rng, 0.6) else []
    return [*parts, *base, *back, *arms]


def stool(rng: np.random.Generator) -> list[Part]:
    """Build a stool without a back: square, round or hollow seat on legs."""
    seat = seat_size(rng, (0.3, 0.5), (0.35, 0.6), (0.02, 0.1))
    style = pick(rng, ("board", "rounded", "cushion", "bent", "slatted"))
    base, _ = legged_base(rng, seat)
    return [*seat_parts(rng, seat, style), *base]


def _round_legs(rng: np.random.Generator, seat: Seat, high: float) -> list[Part]:
    """Build three to five legs on a circle under a round seat, with a ring or bars between them."""
    count = pick(rng, (3, 4, 4, 5))
    thick = between(rng, 0.02, 0.04)
    radius = seat.width / 2.0 * between(rng, 0.6, 0.85)
    splay = between(rng, 0.0, 0.1)
    turn = 0.0 if count == 3 else 45.0
    angles = np.radians(turn + 360.0 * np.arange(count) / count)
    out = np.column_stack([np.sin(angles), np.zeros(count), np.cos(angles)])
    tops = out * radius + np.array([0.0, seat.bottom + 0.004, 0.0])
    feet = out * (radius + splay)
    end = thick * between(rng, 0.6, 1.0)
    parts = [cylinder(end / 2.0, foot, top, "leg", 10, thick / 2.0) for foot, top in zip(feet, tops, strict=True)]
    kind = pick(rng, ("none", "ring", "bars"))
    fraction = between(rng, 0.2, high)
    at = feet + (tops - feet) * fraction
    if kind == "bars":
        parts += [cylinder(thick * 0.35, at[i], at[(i + 1) % count], "stretcher", 8) for i in range(count)]
    elif kind == "ring":
        turns = np.linspace(0.0, 2.0 * np.pi, 21)
        r = radius + splay * (1.0 - fraction)
        path = np.column_stack([np.sin(turns) * r, np.full(21, at[0, 1]), np.cos(turns) * r])
        parts.append(sweep(ellipse(0.018, 0.018, 6), path, "stretcher"))
    return parts


def round_stool(rng: np.random.Generator) -> list[Part]:
    """Round seat on three to five legs, low or bar high, now and then with a low back."""
    width = between(rng, 0.3, 0.46)
    seat = Seat(width, width, pick(rng, (between(rng, 0.38, 0.5), between(rng, 0.6, 0.8))), between(rng, 0.02, 0.09))
    parts = [*seat_parts(rng, seat, "round"), *_round_legs(rng, seat, 0.6)]
    if happens(rng, 0.25):
        bend = random_bend(rng, width * 0.62, between(rng, 0.2, 0.4), (2.0, 12.0), 0.02)
        parts += back_parts(rng, seat, bend, some_back(rng, ("hoop", "ladder", "slats", "solid_panel")), None, 0.045)[0]
    return parts


def bar_chair(rng: np.random.Generator) -> list[Part]:
    """Build a bar-high seat on legs with foot rests and a low or middle back."""
    seat = seat_size(rng, (0.34, 0.48), (0.6, 0.82), (0.02, 0.08))
    base, _ = legged_base(
        rng, seat, ("square", "tapered", "round", "cone"), between(rng, 0.0, 0.07), ("ring", "ring", "h", "front"), 0.45
    )
    parts = [*seat_parts(rng, seat, pick(rng, ("board", "rounded", "cushion", "board_cushion"))), *base]
    if happens(rng, 0.8):
        bend = random_bend(rng, seat.width * between(rng, 0.85, 1.0), between(rng, 0.15, 0.5))
        back, foot = back_parts(rng, seat, bend, some_back(rng, ()))
        parts += back
        if happens(rng, 0.2):
            parts += _arms(rng, seat, foot, bend, ("posts", "loop"))
    return parts


def bench(rng: np.random.Generator) -> list[Part]:
    """Build a wide seat on legs, trestles or boards, with a back or not."""
    seat = Seat(between(rng, 0.85, 1.6), between(rng, 0.3, 0.5), between(rng, 0.38, 0.48), between(rng, 0.02, 0.09))
    style = pick(rng, ("board", "slatted", "cushion", "board_cushion"))
    if style == "slatted":
        # The slats carry themselves: legs stand anywhere under them, not only under the rails.
        seat = replace(seat, thickness=min(seat.thickness, 0.03))
    parts = seat_parts(rng, seat, style)
    kind = pick(rng, ("legs", "trestle", "panels"))
    if kind == "legs":
        parts += legged_base(rng, seat)[0]
    elif kind == "trestle":
        parts += trestle_legs(rng, seat.width, seat.depth, seat.bottom + 0.003)
    else:
        parts += side_panels(rng, seat.width * between(rng, 0.85, 1.0), seat.depth, seat.bottom + 0.003)
    if happens(rng, 0.6):
        bend = random_bend(rng, seat.width * between(rng, 0.92, 1.0), between(rng, 0.3, 0.55), (2.0, 15.0), 0.02)
        styles = ("solid_panel", "slats", "ladder", "cross_frame", "lattice", "padded_frame", "upholstered")
        back, foot = back_parts(rng, seat, bend, pick(rng, styles))
        parts += back
        if happens(rng, 0.6):
            parts += _arms(rng, seat, foot, bend)
    return parts


def folding(rng: np.random.Generator) -> list[Part]:
    """Build crossing legs at both sides; a slatted or plain seat and back."""
    seat = seat_size(rng, (0.38, 0.5), (0.42, 0.48), (0.018, 0.035))
    parts = seat_parts(rng, seat, pick(rng, ("board", "slatted", "rounded")))
    parts += crossed_legs(rng, seat.width * between(rng, 0.85, 1.0), seat.depth, seat.bottom + 0.004)
    if happens(rng, 0.85):
        bend = random_bend(rng, seat.width * between(rng, 0.85, 1.0), between(rng, 0.3, 0.5), (5.0, 20.0))
        back, _ = back_parts(rng, seat, bend, pick(rng, ("ladder", "slats", "raised_panel", "solid_panel")), 0.022)
        parts += back
    return parts


def garden(rng: np.random.Generator) -> list[Part]:
    """Build a slatted low seat, leaning slatted back, broad flat arms."""
    seat = Seat(between(rng, 0.5, 0.7), between(rng, 0.45, 0.6), between(rng, 0.3, 0.44), between(rng, 0.045, 0.08))
    legs = corner_legs(rng, seat.width, seat.depth, seat.bottom + 0.004, between(rng, 0.03, 0.06))
    parts = [*seat_parts(rng, seat, "slatted"), *leg_parts(rng, legs, "square"), *apron_parts(legs, 0.06, 0.022)]
    bend = random_bend(rng, seat.width * between(rng, 0.86, 1.0), between(rng, 0.45, 0.8), (10.0, 28.0), 0.02)
    back, foot = back_parts(rng, seat, bend, pick(rng, ("slats", "slats", "ladder", "lattice")), 0.03)
    arms = _arms(rng, seat, foot, bend, ("posts", "slatted", "frame", "panel"))
    return [*parts, *back, *arms]


def rocking(rng: np.random.Generator) -> list[Part]:
    """Build legs on two curved runners."""
    seat = seat_size(rng, (0.42, 0.6), (0.38, 0.46))
    legs = corner_legs(
        rng, seat.width, seat.depth, seat.bottom + 0.004, between(rng, 0.025, 0.045), between(rng, 0.0, 0.03)
    )
    legs.feet[:, 1] = 0.06
    parts = [
        *seat_parts(rng, seat, pick(rng, ("board", "rounded", "slatted", "cushion"))),
        *leg_parts(rng, legs, pick(rng, ("square", "round", "turned"))),
        *rocker_runners(rng, legs.feet, seat.depth * between(rng, 1.5, 2.0)),
        *stretcher_parts(rng, legs, pick(rng, ("none", "h", "ring", "sides")), 0.3, 0.6),
    ]
    bend = random_bend(rng, seat.width * between(rng, 0.85, 1.0), between(rng, 0.5, 0.85), (8.0, 22.0))
    back, foot = back_parts(rng, seat, bend, some_back(rng, ("slats", "ladder", "spindles", "upholstered", "hoop")))
    arms = _arms(rng, seat, foot, bend, ("posts", "slatted", "frame")) if happens(rng, 0.75) else []
    return [*parts, *back, *arms]


def plank(rng: np.random.Generator) -> list[Part]:
    """Build full boards as sides instead of legs: children's and board chairs."""
    seat = seat_size(rng, (0.35, 0.65), (0.3, 0.46), (0.02, 0.12))
    parts = seat_parts(rng, seat, pick(rng, ("board", "cushion", "slatted")))
    bend = random_bend(rng, seat.width, between(rng, 0.25, 0.7), (0.0, 14.0), 0.02)
    back, foot = back_parts(rng, seat, bend, pick(rng, ("solid_panel", "slats", "ladder", "raised_panel", "lattice")))
    if happens(rng, 0.5):
        t = between(rng, 0.02, 0.06)
        top = seat.top + between(rng, 0.1, 0.28)
        x = seat.width / 2.0 + t / 2.0 - 0.003
        parts += [box((t, top, seat.depth), (s * x, top / 2.0, 0.0), "arm") for s in (-1.0, 1.0)]
        if happens(rng, 0.5):
            drop = seat.bottom * between(rng, 0.2, 0.9)
            parts.append(
                box((seat.width, drop, 0.025), (0.0, seat.bottom - drop / 2.0 + 0.003, -seat.depth * 0.4), "apron")
            )
    else:
        parts += side_panels(rng, seat.width, seat.depth, seat.bottom + 0.003)
        if happens(rng, 0.3):
            parts += _arms(rng, seat, foot, bend)
    return [*parts, *back]


def three_legged(rng: np.random.Generator) -> list[Part]:
    """Round or oval seat on splayed legs with a narrow hooped or boarded back."""
    width = between(rng, 0.38, 0.5)
    seat = Seat(width, width * between(rng, 0.9, 1.05), between(rng, 0.4, 0.48), between(rng, 0.02, 0.06))
    parts = [
        slab(ellipse(seat.width, seat.depth, 24), seat.bottom, seat.thickness, "seat"),
        *_round_legs(rng, seat, 0.5),
    ]
    bend = random_bend(rng, width * between(rng, 0.5, 0.68), between(rng, 0.3, 0.6), (5.0, 18.0), 0.02)
    styles = ("hoop", "solid_panel", "spindles", "ladder", "oval", "raised_panel", "splat")
    return [*parts, *back_parts(rng, seat, bend, pick(rng, styles), None, 0.05)[0]]


WOODEN_FAMILIES: dict[str, Family] = {
    "dining_panel": _dining(("solid_panel", "raised_panel", "oval")),
    "dining_slats": _dining(("slats", "lattice")),
    "dining_ladder": _dining(("ladder",)),
    "dining_splat": _dining(("splat", "cross_frame")),
    "dining_upholstered": _dining(("upholstered", "padded_frame")),
    "dining_hoop": _dining(("hoop", "spindles"), 0.35),
    "windsor": windsor,
    "armchair_wooden": armchair_wooden,
    "throne": throne,
    "stool": stool,
    "round_stool": round_stool,
    "bar_chair": bar_chair,
    "bench": bench,
    "folding": folding,
    "garden": garden,
    "rocking": rocking,
    "plank": plank,
    "three_legged": three_legged,
}
