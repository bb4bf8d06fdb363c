"""Families of chairs put together from few large blocks or frames."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from kpred.synthetic.chair.bases import pedestal_base, sled_base, star_base
from kpred.synthetic.chair.legs import bracket_feet, corner_legs, leg_parts
from kpred.synthetic.chair.seats import Seat, back_parts, random_bend, seat_parts
from kpred.synthetic.chair.upholstered import standing_cushion
from kpred.synthetic.chance import between, happens, pick
from kpred.synthetic.parts import Part, box, cushion, ellipse, frustum, slab

Family = Callable[[np.random.Generator], list[Part]]


def cube(rng: np.random.Generator) -> list[Part]:
    """Build plain blocks: thick flat sides, back and seat, as one box cut open at the front."""
    width, depth = between(rng, 0.5, 0.75), between(rng, 0.5, 0.75)
    wall = between(rng, 0.03, 0.16)
    seat_top = between(rng, 0.34, 0.46)
    thick = between(rng, 0.06, 0.3)
    height = seat_top + between(rng, 0.18, 0.5)
    level = happens(rng, 0.6)
    arm_top = height if level else seat_top + (height - seat_top) * between(rng, 0.4, 0.8)
    inner = width - 2.0 * wall
    parts = [
        box((inner + 0.004, thick, depth - wall + 0.004), (0.0, seat_top - thick / 2.0, wall / 2.0 - 0.002), "seat"),
        box(
            (width if not level else inner + 0.004, height, wall),
            (0.0, height / 2.0, -(depth - wall) / 2.0),
            "back_panel",
        ),
    ]
    for s in (-1.0, 1.0):
        parts.append(box((wall, arm_top, depth), (s * (width - wall) / 2.0, arm_top / 2.0, 0.0), "arm"))
    if happens(rng, 0.4):
        pad = between(rng, 0.06, 0.12)
        size = (inner * 0.98, height - seat_top - 0.02, pad)
        parts.append(
            standing_cushion(
                size, (0.0, seat_top - 0.005, -depth / 2.0 + wall + pad / 2.0 - 0.01), 6.0, "back_cushion", 0.03
            )
        )
    return parts


def ottoman(rng: np.random.Generator) -> list[Part]:
    """Build a thick padded seat without a back, on feet, legs, a pedestal or the floor."""
    width = between(rng, 0.38, 0.75)
    depth = width * (between(rng, 0.65, 1.1) if happens(rng, 0.6) else 1.0)
    thick, top = between(rng, 0.1, 0.32), between(rng, 0.36, 0.52)
    bottom = top - thick
    round_top = happens(rng, 0.35)
    if round_top:
        body = slab(ellipse(width, depth, 24), bottom, thick, "seat")
    else:
        body = cushion((width, thick, depth), (0.0, top - thick / 2.0, 0.0), "seat", between(rng, 0.01, 0.06), 3)
    inner = (width * 0.7, depth * 0.7) if round_top else (width, depth)
    kind = pick(rng, ("floor", "feet", "legs", "pedestal", "sled"))
    if kind == "floor":
        size = (inner[0] * 0.96, bottom + 0.004, inner[1] * 0.96)
        return [body, box(size, (0.0, size[1] / 2.0, 0.0), "plinth")]
    if kind == "feet":
        return [body, *bracket_feet(*inner, bottom + 0.004, rng)]
    if kind == "pedestal":
        return [body, *pedestal_base(rng, bottom + 0.004, max(width, 0.45))]
    if kind == "sled":
        plate = box((inner[0] * 0.9, 0.03, inner[1] * 0.9), (0.0, bottom - 0.012, 0.0), "seat_frame")
        return [body, plate, *sled_base(rng, inner[0] * 0.9, inner[1] * 0.9, bottom - 0.01)]
    legs = corner_legs(
        rng, *inner, bottom + 0.006, between(rng, 0.025, 0.06), between(rng, 0.0, 0.06), 0.0, between(rng, 0.0, 0.04)
    )
    return [body, *leg_parts(rng, legs, pick(rng, ("square", "tapered", "round", "cone", "turned")))]


def block_seat(rng: np.random.Generator) -> list[Part]:
    """Build a seat and back as two or three slabs, low or on the floor, with low arms or none; modular seating."""
    width, depth = between(rng, 0.48, 0.95), between(rng, 0.5, 0.95)
    feet = between(rng, 0.02, 0.12) if happens(rng, 0.4) else 0.0
    seat_top = feet + (between(rng, 0.06, 0.2) if happens(rng, 0.3) else between(rng, 0.25, 0.42))
    rise, thick = between(rng, 0.2, 0.85), between(rng, 0.05, 0.3)
    soft = between(rng, 0.004, 0.05)
    parts = [cushion((width, seat_top - feet, depth), (0.0, (seat_top + feet) / 2.0, 0.0), "seat", soft, 3)]
    low = seat_top - 0.03
    if happens(rng, 0.35):
        low = feet
    size = (width, seat_top + rise - low, thick)
    parts.append(
        standing_cushion(size, (0.0, low, -(depth - thick) / 2.0), between(rng, 0.0, 14.0), "back_cushion", soft)
    )
    if feet:
        parts += bracket_feet(width, depth, feet + 0.004, rng)
    sides = pick(rng, ("none", "none", "right", "both"))
    wide, tall = between(rng, 0.06, 0.25), between(rng, 0.08, min(0.3, rise))
    for s in (1.0, -1.0):
        if sides == "both" or (sides == "right" and s > 0.0):
            size = (wide, seat_top + tall - feet, depth)
            place = (s * (width + wide) / 2.0 - s * 0.003, (seat_top + tall + feet) / 2.0, 0.0)
            parts.append(cushion(size, place, "arm", soft, 3))
    return parts


def side_frame(rng: np.random.Generator) -> list[Part]:
    """Build two side frames from floor to armrest, seat and back hung between them."""
    width, depth = between(rng, 0.46, 0.66), between(rng, 0.48, 0.78)
    bar, thick = between(rng, 0.025, 0.06), between(rng, 0.025, 0.08)
    seat_top = between(rng, 0.34, 0.46)
    arm = seat_top + between(rng, 0.12, 0.28)
    seat = Seat(width, depth * between(rng, 0.85, 1.0), seat_top, between(rng, 0.04, 0.16))
    x, z = (width + bar) / 2.0 - 0.004, depth / 2.0 - thick / 2.0
    lean, slope = between(rng, -0.02, 0.1), between(rng, -0.06, 0.02)
    runner = happens(rng, 0.35)
    right = [
        frustum((bar, thick), (bar, thick), (x, 0.0, z + lean * 0.4), (x, arm, z), "leg"),
        frustum((bar, thick), (bar, thick), (x, 0.0, -z - lean), (x, arm + slope, -z), "leg"),
    ]
    wide = bar * between(rng, 1.0, 2.2)
    rest = box((wide, thick * 0.7, depth + 0.02), (x, arm, 0.0), "arm")
    right.append(rest.rotated("x", float(np.degrees(np.arctan2(-slope, depth))), (x, arm, z)))
    if runner:
        right.append(box((bar, thick, depth), (x, thick / 2.0, 0.0), "stretcher"))
    if happens(rng, 0.6):
        right.append(box((bar * 0.8, thick, depth - thick), (x, seat.bottom + 0.03, 0.0), "stretcher"))
    parts = [*right, *(part.mirrored_x() for part in right)]
    style = pick(rng, ("cushion", "board_cushion", "slatted", "board"))
    parts += seat_parts(rng, seat, style)
    parts.append(box((width + bar, thick * 0.8, 0.03), (0.0, seat.bottom + 0.012, z - 0.03), "seat_frame"))
    parts.append(box((width + bar, thick * 0.8, 0.03), (0.0, seat.bottom + 0.012, -z + 0.03), "seat_frame"))
    bend = random_bend(rng, width, between(rng, 0.28, 0.65), (4.0, 26.0), 0.03)
    back = pick(rng, ("upholstered", "upholstered", "slats", "ladder", "solid_panel", "padded_frame"))
    return [*parts, *back_parts(rng, seat, bend, back, between(rng, 0.025, 0.1))[0]]


def swivel_tub(rng: np.random.Generator) -> list[Part]:
    """Build a block-like seat, back and arms on a swivel star or pedestal."""
    width, depth = between(rng, 0.46, 0.62), between(rng, 0.48, 0.62)
    bottom, thick = between(rng, 0.24, 0.36), between(rng, 0.1, 0.2)
    seat_top = bottom + thick
    wall, rise = between(rng, 0.04, 0.12), between(rng, 0.22, 0.6)
    soft = between(rng, 0.01, 0.04)
    parts = [
        cushion((width, thick, depth), (0.0, bottom + thick / 2.0, 0.0), "seat", soft, 3),
        standing_cushion(
            (width, rise + 0.06, wall),
            (0.0, seat_top - 0.06, -(depth - wall) / 2.0),
            between(rng, 2.0, 16.0),
            "back_cushion",
            soft,
        ),
    ]
    if happens(rng, 0.85):
        tall = between(rng, 0.12, min(0.26, rise))
        for s in (-1.0, 1.0):
            size = (wall, thick + tall, depth * 0.95)
            parts.append(
                cushion(size, (s * (width + wall - 0.008) / 2.0, bottom + (thick + tall) / 2.0, 0.0), "arm", soft)
            )
    if happens(rng, 0.6):
        return [*parts, *star_base(rng, bottom + 0.02, between(rng, 0.26, 0.35), happens(rng, 0.6))]
    return [*parts, *pedestal_base(rng, bottom + 0.01, width)]


BLOCK_FAMILIES: dict[str, Family] = {
    "cube": cube,
    "ottoman": ottoman,
    "block_seat": block_seat,
    "side_frame": side_frame,
    "swivel_tub": swivel_tub,
}
