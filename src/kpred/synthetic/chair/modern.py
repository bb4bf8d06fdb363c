"""Families of chairs on swivels, pedestals, bent tubes and runners."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from kpred.synthetic.chair.arms import arm_parts
from kpred.synthetic.chair.backs import Bend
from kpred.synthetic.chair.bases import cantilever_tube, pedestal_base, sled_base, star_base
from kpred.synthetic.chair.legs import corner_legs, leg_parts
from kpred.synthetic.chair.seats import Seat, back_parts, random_bend, seat_parts, seat_size
from kpred.synthetic.chair.shells import shell
from kpred.synthetic.chance import between, happens, pick
from kpred.synthetic.parts import Part, box, cushion, cylinder, ellipse, sweep
from kpred.synthetic.paths import rounded_path

Family = Callable[[np.random.Generator], list[Part]]


def _swivel_seat(seat: Seat, radius: float) -> list[Part]:
    """Build a padded seat with rounded edges and the plate under it."""
    middle = (0.0, seat.top - seat.thickness / 2.0, 0.0)
    return [
        cushion((seat.width, seat.thickness, seat.depth), middle, "seat", radius, 3),
        box((0.16, 0.03, 0.16), (0.0, seat.bottom - 0.012, 0.0), "seat_frame"),
    ]


def _arms(
    rng: np.random.Generator, seat: Seat, styles: tuple[str, ...], rise: tuple[float, float], foot: float, bend: Bend
) -> list[Part]:
    """Build armrests of one of the styles, so far above the seat; `foot`: z of the foot of the back."""
    style = pick(rng, styles)
    height = between(rng, *rise)
    return arm_parts(rng, style, seat.width, seat.depth, seat.top, seat.bottom, height, foot, bend)


def office_task(rng: np.random.Generator) -> list[Part]:
    """Build a swivel chair with castors, padded seat, and a back on a bar or right on the seat."""
    seat = seat_size(rng, (0.42, 0.56), (0.4, 0.54), (0.04, 0.1))
    parts = _swivel_seat(seat, between(rng, 0.02, 0.05))
    parts += star_base(rng, seat.bottom - 0.01, between(rng, 0.26, 0.34))
    bend = random_bend(rng, seat.width * between(rng, 0.75, 1.0), between(rng, 0.3, 0.62), (3.0, 18.0))
    style = pick(rng, ("stem", "stem", "padded_frame", "upholstered", "raised_panel", "hoop"))
    back, foot = back_parts(rng, seat, bend, style, between(rng, 0.02, 0.06), 0.0 if style == "stem" else 0.01)
    parts += back
    if happens(rng, 0.65):
        parts += _arms(rng, seat, ("pad", "pad", "loop", "posts"), (0.16, 0.26), foot, bend)
    return parts


def office_executive(rng: np.random.Generator) -> list[Part]:
    """Build a swivel chair with thick seat, high padded back, perhaps a head rest, and arms."""
    seat = seat_size(rng, (0.48, 0.64), (0.42, 0.54), (0.08, 0.16))
    parts = _swivel_seat(seat, between(rng, 0.03, 0.06))
    parts += star_base(rng, seat.bottom - 0.01, between(rng, 0.28, 0.37))
    bend = random_bend(rng, seat.width * between(rng, 0.85, 1.0), between(rng, 0.55, 0.85), (5.0, 20.0))
    thick = between(rng, 0.05, 0.09)
    back, foot = back_parts(rng, seat, bend, pick(rng, ("upholstered", "solid_panel", "padded_frame")), thick)
    parts += back
    if happens(rng, 0.4):
        tall = between(rng, 0.1, 0.18)
        head = cushion((bend.width * 0.6, thick * 0.8, tall), (0.0, 0.0, 0.0), "head_rest", 0.03, 3).rotated("x", 90.0)
        place = (0.0, bend.height - tall * between(rng, 0.1, 0.6), thick * 0.6 - 0.8 * bend.bow)
        parts.append(replace(bend, bow=0.0, arch=0.0, taper=1.0).apply(head.moved(place)).moved((0.0, seat.top, foot)))
    return parts + _arms(rng, seat, ("pad", "loop", "posts", "sloping"), (0.17, 0.27), foot, bend)


def pedestal_chair(rng: np.random.Generator) -> list[Part]:
    """Build a seat with a back on one stem: bar stools with a back, cafe and conference chairs."""
    high = happens(rng, 0.4)
    seat = seat_size(rng, (0.36, 0.55), (0.58, 0.8) if high else (0.38, 0.5), (0.02, 0.1))
    parts = seat_parts(rng, seat, pick(rng, ("rounded", "cushion", "board", "bent")))
    parts += pedestal_base(rng, seat.bottom + 0.004, max(seat.width, 0.42))
    bend = random_bend(rng, seat.width * between(rng, 0.8, 1.0), between(rng, 0.15, 0.55), (2.0, 18.0))
    style = pick(rng, ("solid_panel", "raised_panel", "upholstered", "padded_frame", "ladder", "hoop"))
    back, foot = back_parts(rng, seat, bend, style)
    parts += back
    if high:
        parts += foot_rest(rng, seat)
    if happens(rng, 0.3):
        parts += _arms(rng, seat, ("loop", "posts", "pad"), (0.14, 0.24), foot, bend)
    return parts


def foot_rest(rng: np.random.Generator, seat: Seat) -> list[Part]:
    """Build a bar loop in front of the column of a bar stool."""
    y, out = seat.bottom * between(rng, 0.3, 0.5), between(rng, 0.1, 0.17)
    wide = between(rng, 0.06, 0.13)
    path = rounded_path(
        [(0.0, y, 0.0), (wide, y, 0.02), (wide, y, out), (-wide, y, out), (-wide, y, 0.02), (0.0, y, -0.005)], 0.04, 3
    )
    return [sweep(ellipse(0.018, 0.018, 6), path, "foot_rest")]


def bar_stool(rng: np.random.Generator) -> list[Part]:
    """Round or square seat without a back on one stem, bar high."""
    width = between(rng, 0.3, 0.45)
    seat = Seat(width, width, between(rng, 0.55, 0.82), between(rng, 0.025, 0.1))
    style = pick(rng, ("round", "round", "rounded", "cushion", "board"))
    parts = [*seat_parts(rng, seat, style), *pedestal_base(rng, seat.bottom + 0.004, max(width, 0.4))]
    if happens(rng, 0.5):
        parts += foot_rest(rng, seat)
    return parts


def cantilever(rng: np.random.Generator) -> list[Part]:
    """Build a bent tube without rear legs."""
    seat = seat_size(rng, (0.42, 0.56), (0.4, 0.48), (0.02, 0.07))
    gauge = seat.width * between(rng, 0.92, 1.02)
    rise, lean = between(rng, 0.3, 0.55), between(rng, 2.0, 16.0)
    rails = seat.bottom + 0.004
    rear = -seat.depth / 2.0
    run = np.tan(np.radians(lean))
    parts = seat_parts(rng, seat, pick(rng, ("board", "rounded", "cushion")))
    if happens(rng, 0.65):
        height = seat.top + rise
        top = np.array([gauge / 2.0, height, rear - (height - rails) * run])
        parts += cantilever_tube(rng, gauge, seat.depth, rails, [top])
        low = between(rng, 0.1, 0.65) * rise
        if happens(rng, 0.5):
            low = 0.0
        tall = rise - low - 0.01
        pad = box((gauge + 0.005, tall, between(rng, 0.012, 0.05)), (0.0, tall / 2.0, 0.0), "back_panel")
        start = seat.top + low
        parts.append(pad.rotated("x", -lean).moved((0.0, start, rear - (start - rails) * run)))
        if happens(rng, 0.35):
            parts += arm_parts(rng, "loop", gauge, seat.depth, seat.top, rails, between(rng, 0.16, 0.24), rear)
        return parts
    parts += cantilever_tube(rng, gauge * 0.9, seat.depth * 0.95, rails, None)
    bend = random_bend(rng, seat.width, rise, (2.0, 16.0))
    return [
        *parts,
        *back_parts(rng, seat, bend, pick(rng, ("solid_panel", "upholstered", "ladder", "raised_panel")))[0],
    ]


def sled(rng: np.random.Generator) -> list[Part]:
    """Build side loops on the floor under a seat with a back, armed or not."""
    seat = seat_size(rng, (0.42, 0.65), (0.36, 0.48))
    parts = seat_parts(rng, seat, pick(rng, ("board", "rounded", "cushion", "board_cushion", "bent")))
    parts += sled_base(
        rng, seat.width * between(rng, 0.85, 1.0), seat.depth * between(rng, 0.85, 1.0), seat.bottom + 0.006
    )
    bend = random_bend(rng, seat.width * between(rng, 0.88, 1.0), between(rng, 0.3, 0.6), (3.0, 20.0))
    style = pick(rng, ("solid_panel", "raised_panel", "upholstered", "padded_frame", "ladder", "slats"))
    back, foot = back_parts(rng, seat, bend, style)
    parts += back
    if happens(rng, 0.4):
        parts += _arms(rng, seat, ("loop", "frame", "posts"), (0.16, 0.26), foot, bend)
    return parts


def lounger(rng: np.random.Generator) -> list[Part]:
    """Build a low, long seat with a far leaning back."""
    seat = Seat(between(rng, 0.5, 0.7), between(rng, 0.5, 0.85), between(rng, 0.26, 0.4), between(rng, 0.03, 0.12))
    rise, lean = between(rng, 0.45, 0.8), between(rng, 22.0, 42.0)
    if happens(rng, 0.4):
        parts = shell(rng, seat, rise, lean, between(rng, 0.02, 0.05), between(rng, 0.0, 0.03))
        block = box((seat.width * 0.5, 0.07, seat.depth * 0.6), (0.0, seat.top - 0.05, 0.0), "seat_frame")
        parts.append(block)
        bottom = seat.top - 0.06
    else:
        parts = seat_parts(rng, seat, pick(rng, ("cushion", "slatted", "board_cushion")))
        bend = random_bend(rng, seat.width * between(rng, 0.9, 1.0), rise, (lean, lean + 1.0), 0.02)
        back, foot = back_parts(
            rng, seat, bend, pick(rng, ("upholstered", "padded_frame", "slats", "ladder")), between(rng, 0.03, 0.09)
        )
        parts += back
        bottom = seat.bottom + 0.005
        if happens(rng, 0.5):
            parts += _arms(rng, seat, ("posts", "frame", "loop"), (0.14, 0.22), foot, bend)
    kind = pick(rng, ("sled", "legs", "star"))
    if kind == "sled":
        parts.append(box((seat.width * 0.95, 0.03, seat.depth * 0.9), (0.0, bottom - 0.005, 0.0), "seat_frame"))
        parts += sled_base(rng, seat.width * 0.8, seat.depth, bottom)
    elif kind == "legs":
        legs = corner_legs(
            rng,
            seat.width * 0.95,
            seat.depth * 0.95,
            bottom,
            between(rng, 0.025, 0.05),
            between(rng, 0.0, 0.06),
            between(rng, 0.0, 0.1),
        )
        parts.append(box((seat.width * 0.95, 0.03, seat.depth * 0.95), (0.0, bottom - 0.005, 0.0), "seat_frame"))
        parts += leg_parts(rng, legs, pick(rng, ("round", "cone", "square")))
    else:
        parts.append(box((seat.width * 0.95, 0.03, seat.depth * 0.4), (0.0, bottom - 0.005, 0.0), "seat_frame"))
        parts += star_base(rng, bottom + 0.01, between(rng, 0.28, 0.36), False)
    if happens(rng, 0.25):
        parts += _ottoman_rest(rng, seat)
    return parts


def _ottoman_rest(rng: np.random.Generator, seat: Seat) -> list[Part]:
    """Build a leg rest joined to the front of the seat."""
    long, slope = between(rng, 0.3, 0.5), between(rng, 5.0, 25.0)
    pad = cushion((seat.width * 0.9, 0.06, long), (0.0, 0.0, long / 2.0 - 0.02), "foot_rest", 0.02, 2)
    return [
        pad.rotated("x", slope).moved((0.0, seat.top - 0.035, seat.depth / 2.0)),
        cylinder(
            0.012,
            (-seat.width * 0.4, seat.top - 0.04, seat.depth / 2.0),
            (seat.width * 0.4, seat.top - 0.04, seat.depth / 2.0),
            "foot_rest",
            8,
        ),
    ]


MODERN_FAMILIES: dict[str, Family] = {
    "office_task": office_task,
    "office_executive": office_executive,
    "pedestal": pedestal_chair,
    "bar_stool": bar_stool,
    "cantilever": cantilever,
    "sled": sled,
    "lounger": lounger,
}
