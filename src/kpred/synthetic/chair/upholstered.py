"""Families of upholstered chairs: club and wing chairs, recliners, barrels, sofas."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from kpred.synthetic.chair.arms import upholstered_sides
from kpred.synthetic.chair.bases import disc_base, star_base
from kpred.synthetic.chair.legs import bracket_feet
from kpred.synthetic.chair.seats import Seat
from kpred.synthetic.chance import between, happens, pick
from kpred.synthetic.part import Number
from kpred.synthetic.parts import Part, box, cushion, ellipse, frustum, slab, sweep
from kpred.synthetic.paths import arc

Family = Callable[[np.random.Generator], list[Part]]


def standing_cushion(
    size: tuple[Number, Number, Number],
    foot: tuple[Number, Number, Number],
    lean: Number,
    label: str,
    radius: Number,
) -> Part:
    """Build a cushion (width, height, thickness) on its lower edge, leaned back by degrees."""
    width, height, thick = size
    pad = cushion((width, thick, height), (0.0, 0.0, 0.0), label, radius, 3).rotated("x", 90.0)
    return pad.moved((0.0, height / 2.0, 0.0)).rotated("x", -lean).moved(foot)


def upholstery(
    rng: np.random.Generator,
    width: float,
    places: int,
    arms: bool,
    back_rise: tuple[float, float],
    lean: tuple[float, float],
    split_back: bool,
) -> list[Part]:
    """Build box-like seating with `places` seat cushions of total `width`."""
    depth = between(rng, 0.5, 0.92)
    feet = between(rng, 0.02, 0.2)
    base_top = feet + between(rng, 0.06, 0.24)
    pad = between(rng, 0.07, 0.22)
    seat_top = base_top + pad - 0.01
    rise = between(rng, *back_rise)
    tilt = between(rng, *lean)
    thick = between(rng, 0.09, 0.3) * depth / 0.75
    side = between(rng, 0.05, 0.28) if arms else 0.0
    soft = between(rng, 0.015, 0.06)
    rear = -depth / 2.0
    parts = [box((width, base_top - feet, depth), (0.0, (base_top + feet) / 2.0, 0.0), "seat_frame")]
    parts += bracket_feet(width + 1.6 * side, depth, feet + 0.004, rng)
    each = width / places
    front = depth / 2.0 + between(rng, -0.02, 0.04)
    inner = rear + thick * 0.85
    for k in range(places):
        x = -width / 2.0 + each * (k + 0.5)
        size = (each - 0.004, pad, front - inner)
        parts.append(cushion(size, (x, base_top + pad / 2.0 - 0.01, (front + inner) / 2.0), "seat_cushion", soft, 3))
    foot = (0.0, feet + 0.02, rear + thick / 2.0)
    tall = seat_top + rise - feet
    wide = width + (2.0 * side if happens(rng, 0.35) else 0.0)
    if split_back or places > 1:
        frame = thick * 0.5
        parts.append(
            standing_cushion(
                (wide, tall * between(rng, 0.75, 0.95), frame),
                (0.0, feet + 0.02, rear + frame / 2.0),
                tilt,
                "back_frame",
                soft * 0.5,
            )
        )
        for k in range(places):
            x = -width / 2.0 + each * (k + 0.5)
            size = (each - 0.004, seat_top + rise - base_top, thick * 0.7)
            shift = -(base_top - feet) * np.tan(np.radians(tilt))
            parts.append(
                standing_cushion(size, (x, base_top, rear + frame + thick * 0.28 + shift), tilt, "back_cushion", soft)
            )
    else:
        parts.append(standing_cushion((wide, tall, thick), foot, tilt, "back_cushion", soft))
    if arms:
        top = seat_top + min(between(rng, 0.08, 0.3) if happens(rng, 0.75) else rise, rise * 0.93)
        low = feet if happens(rng, 0.7) else max(0.0, feet - 0.03)
        parts += upholstered_sides(rng, width, depth, low, top, side)
    return parts


def club(rng: np.random.Generator) -> list[Part]:
    """Build an armchair with solid padded sides."""
    return upholstery(rng, between(rng, 0.44, 0.66), 1, True, (0.25, 0.55), (0.0, 15.0), happens(rng, 0.4))


def slipper(rng: np.random.Generator) -> list[Part]:
    """Build a padded chair without arms."""
    return upholstery(rng, between(rng, 0.48, 0.75), 1, False, (0.28, 0.65), (2.0, 20.0), happens(rng, 0.3))


def sofa_two(rng: np.random.Generator) -> list[Part]:
    """Build a sofa with two seats."""
    return upholstery(rng, between(rng, 0.95, 1.35), 2, happens(rng, 0.85), (0.28, 0.5), (0.0, 14.0), True)


def sofa_three(rng: np.random.Generator) -> list[Part]:
    """Build a sofa with three seats."""
    return upholstery(rng, between(rng, 1.4, 1.95), 3, happens(rng, 0.85), (0.25, 0.48), (0.0, 14.0), True)


def wing(rng: np.random.Generator) -> list[Part]:
    """Build a high padded back with wings at both sides over padded arms."""
    width, depth = between(rng, 0.48, 0.62), between(rng, 0.55, 0.72)
    feet, pad = between(rng, 0.08, 0.2), between(rng, 0.08, 0.15)
    base_top = feet + between(rng, 0.08, 0.16)
    seat_top = base_top + pad - 0.01
    rise, tilt = between(rng, 0.55, 0.85), between(rng, 2.0, 14.0)
    thick, side = between(rng, 0.08, 0.15), between(rng, 0.06, 0.13)
    rear = -depth / 2.0
    parts = [
        box((width, base_top - feet, depth), (0.0, (base_top + feet) / 2.0, 0.0), "seat_frame"),
        cushion((width, pad, depth * 0.9), (0.0, base_top + pad / 2.0 - 0.01, depth * 0.07), "seat_cushion", 0.04, 3),
        standing_cushion(
            (width + 0.01, seat_top + rise - feet, thick),
            (0.0, feet + 0.01, rear + thick / 2.0),
            tilt,
            "back_cushion",
            0.04,
        ),
        *bracket_feet(width + side, depth, feet + 0.004, rng),
    ]
    arm_top = seat_top + between(rng, 0.14, 0.26)
    parts += upholstered_sides(rng, width, depth, feet, arm_top, side)
    # The wing is a board at the edge of the back, leaning with it, from arm to crown.
    reach, crown = between(rng, 0.12, 0.26), between(rng, 0.5, 1.0)
    low, high = arm_top - feet - 0.04, seat_top + rise - feet - between(rng, 0.0, 0.06)
    outline = np.array(
        [[-thick / 2, low], [reach * 1.1, low], [reach, (low + high) / 2], [reach * crown, high], [-thick / 2, high]]
    )
    x = width / 2.0
    right = sweep(outline, np.array([[x - 0.012, 0.0, 0.0], [x + side * 0.6, 0.0, 0.0]]), "wing")
    right = right.rotated("x", -tilt).moved((0.0, feet + 0.01, rear + thick / 2.0))
    return [*parts, right, right.mirrored_x()]


def recliner(rng: np.random.Generator) -> list[Part]:
    """Build a heavy armchair, leaning back, leg rest partly out."""
    width, depth = between(rng, 0.5, 0.62), between(rng, 0.6, 0.75)
    feet = between(rng, 0.02, 0.08)
    seat_top = between(rng, 0.38, 0.48)
    thick, side = between(rng, 0.14, 0.22), between(rng, 0.12, 0.22)
    tilt, rise = between(rng, 15.0, 38.0), between(rng, 0.5, 0.75)
    rear = -depth / 2.0
    foot = (0.0, seat_top - 0.1, rear + thick / 2.0)
    parts = [
        box((width, seat_top - 0.1 - feet, depth), (0.0, (seat_top - 0.1 + feet) / 2.0, 0.0), "seat_frame"),
        cushion((width, 0.14, depth), (0.0, seat_top - 0.07, 0.0), "seat_cushion", 0.05, 3),
        standing_cushion((width, rise + 0.1, thick), foot, tilt, "back_cushion", 0.06),
        *bracket_feet(width + side, depth, feet + 0.004, rng),
        *upholstered_sides(rng, width, depth, feet, seat_top + between(rng, 0.12, 0.22), side),
    ]
    if happens(rng, 0.6):
        long = between(rng, 0.3, 0.5)
        pad = cushion((width * 0.95, 0.1, long), (0.0, 0.0, long / 2.0 - 0.03), "foot_rest", 0.04, 3)
        parts.append(pad.rotated("x", between(rng, -5.0, 40.0)).moved((0.0, seat_top - 0.09, depth / 2.0)))
    if happens(rng, 0.4):
        head = standing_cushion(
            (width * 0.75, 0.2, thick * 0.5), (0.0, rise - 0.12, thick * 0.55), 0.0, "head_rest", 0.04
        )
        parts.append(
            head.rotated("x", -tilt).moved((0.0, seat_top, rear + thick / 2.0 - 0.1 * np.tan(np.radians(tilt))))
        )
    return parts


def barrel(rng: np.random.Generator) -> list[Part]:
    """Round seat within a curved back that runs into the arms."""
    width = between(rng, 0.5, 0.75)
    depth = width * between(rng, 0.9, 1.1)
    feet = between(rng, 0.03, 0.22)
    seat_top = between(rng, 0.38, 0.46)
    pad = between(rng, 0.06, 0.14)
    thick = between(rng, 0.035, 0.12)
    rise = between(rng, 0.22, 0.5)
    fall = between(rng, 0.0, 0.65)
    parts = [
        slab(ellipse(width * 0.98, depth * 0.98, 24), feet, seat_top - pad - feet + 0.01, "seat_frame"),
        slab(ellipse(width * 0.92, depth * 0.94, 24), seat_top - pad, pad, "seat_cushion"),
    ]
    spread = between(rng, 0.0, 30.0)
    low = feet if happens(rng, 0.6) else seat_top - pad * 0.6
    path = arc((0.0, 0.0, 0.0), width / 2.0, depth / 2.0, spread, -180.0 - spread, 16)
    tall = seat_top + rise - low
    # Section: across the wall, and up from its lower edge; the wall falls towards the front as arms.
    section = np.array([[-thick / 2, 0.0], [thick / 2, 0.0], [thick / 2, tall], [-thick / 2, tall]])
    wall = sweep(section, path + np.array([0.0, low, 0.0]), "back_panel")
    vertices = wall.vertices.copy()
    fraction = np.clip((vertices[:, 2] + depth / 2.0) / (depth * 0.85), 0.0, 1.0)
    top = vertices[:, 1] > low + tall * 0.5
    drop = min(rise * fall, rise - 0.04)
    smooth = fraction**2 * (3.0 - 2.0 * fraction)
    vertices[top, 1] -= drop * smooth[top]
    lean = np.tan(np.radians(between(rng, 0.0, 14.0)))
    vertices[top, 2] -= (lean * rise * (1.0 - fraction))[top]
    parts.append(Part(vertices, wall.faces, wall.label, wall.axes, wall.ring))
    kind = pick(rng, ("feet", "feet", "star", "disc"))
    if kind == "feet" or feet < 0.12:
        parts += _ring_feet(rng, width, depth, feet + 0.004)
    elif kind == "star":
        parts += star_base(rng, feet + 0.01, width * 0.45, False)
    else:
        parts += disc_base(rng, feet + 0.01, width * 0.42)
    return parts


def _ring_feet(rng: np.random.Generator, width: float, depth: float, height: float) -> list[Part]:
    if happens(rng, 0.25):
        return [slab(ellipse(width * 0.85, depth * 0.85, 24), 0.0, height, "plinth")]
    t, end = between(rng, 0.03, 0.05), between(rng, 0.015, 0.03)
    splay = between(rng, 0.0, 0.04)
    parts = []
    for sx in (-1.0, 1.0):
        for sz in (-1.0, 1.0):
            x, z = sx * width * 0.3, sz * depth * 0.3
            parts.append(frustum((end, end), (t, t), (x + sx * splay, 0.0, z + sz * splay), (x, height, z), "leg"))
    return parts


def chaise(rng: np.random.Generator) -> list[Part]:
    """Build a long seat with a back at its rear end and low sides or none."""
    width, depth = between(rng, 0.55, 0.75), between(rng, 1.0, 1.5)
    feet, seat_top = between(rng, 0.05, 0.16), between(rng, 0.34, 0.44)
    seat = Seat(width, depth, seat_top, seat_top - feet)
    thick = between(rng, 0.1, 0.18)
    middle = feet + seat.thickness * between(rng, 0.3, 0.6)
    parts = [
        box((width, middle - feet, depth), (0.0, (middle + feet) / 2.0, 0.0), "seat_frame"),
        cushion(
            (width, seat_top - middle + 0.01, depth), (0.0, (seat_top + middle) / 2.0, 0.0), "seat_cushion", 0.04, 3
        ),
        *bracket_feet(width, depth, feet + 0.004, rng),
    ]
    rise, tilt = between(rng, 0.35, 0.6), between(rng, 10.0, 35.0)
    foot = (0.0, seat_top - 0.06, -depth / 2.0 + thick / 2.0)
    parts.append(standing_cushion((width, rise + 0.06, thick), foot, tilt, "back_cushion", 0.05))
    if happens(rng, 0.5):
        long, tall, side = depth * between(rng, 0.3, 0.6), between(rng, 0.12, 0.25), between(rng, 0.06, 0.12)
        for s in (-1.0, 1.0):
            size = (side, seat_top + tall - feet, long)
            place = (s * (width + side) / 2.0, (seat_top + tall + feet) / 2.0, (long - depth) / 2.0)
            parts.append(cushion(size, place, "arm", 0.03, 3))
    return parts


UPHOLSTERED_FAMILIES: dict[str, Family] = {
    "club": club,
    "slipper": slipper,
    "wing": wing,
    "recliner": recliner,
    "barrel": barrel,
    "chaise": chaise,
    "sofa_two": sofa_two,
    "sofa_three": sofa_three,
}
