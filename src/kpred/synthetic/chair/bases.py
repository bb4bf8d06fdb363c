"""Bases of chairs other than four corner legs: swivel stars, pedestals, bent tubes, runners, side panels."""

from __future__ import annotations

import numpy as np

from kpred.synthetic.chance import between, happens, pick, whole
from kpred.synthetic.parts import Part, beam, box, cylinder, ellipse, frustum, lathe, rounded_rectangle, sweep
from kpred.synthetic.paths import rounded_path


def star_base(rng: np.random.Generator, height: float, radius: float, castors: bool = True) -> list[Part]:
    """Build four or five sloping spokes, a column up to `height`, and castors or glides."""
    spokes = 5 if happens(rng, 0.8) else 4
    wheel = between(rng, 0.02, 0.032) if castors else between(rng, 0.008, 0.015)
    hub, thick = between(rng, 0.03, 0.05), between(rng, 0.025, 0.045)
    floor = 2.0 * wheel
    rise = between(rng, 0.02, 0.07)
    parts = [
        cylinder(hub, (0.0, floor - 0.005, 0.0), (0.0, floor + rise + thick, 0.0), "column", 12),
        cylinder(between(rng, 0.018, 0.03), (0.0, floor + rise, 0.0), (0.0, height, 0.0), "column", 12),
    ]
    if happens(rng, 0.7):
        sleeve = floor + rise + (height - floor - rise) * between(rng, 0.4, 0.7)
        parts.append(cylinder(between(rng, 0.03, 0.036), (0.0, floor + rise, 0.0), (0.0, sleeve, 0.0), "column", 12))
    turn = between(rng, 0.0, 360.0)
    for k in range(spokes):
        angle = np.radians(turn + 360.0 * k / spokes)
        out = np.array([np.sin(angle), 0.0, np.cos(angle)])
        tip = out * radius + np.array([0.0, floor + thick * 0.3, 0.0])
        parts.append(beam(np.array([0.0, floor + rise + thick * 0.5, 0.0]), tip, thick, thick * 0.8, "spoke"))
        if castors:
            side = np.cross(out, (0.0, 1.0, 0.0)) * wheel * 0.9
            center = out * (radius - wheel * 0.5) + np.array([0.0, wheel, 0.0])
            parts.append(cylinder(wheel, center - side, center + side, "castor", 10))
        else:
            tip[1] = 0.0
            parts.append(cylinder(wheel, tip, tip + np.array([0.0, floor + thick * 0.2, 0.0]), "castor", 8))
    return parts


def disc_base(rng: np.random.Generator, height: float, radius: float) -> list[Part]:
    """Build a round plate and a column."""
    plate = between(rng, 0.012, 0.04)
    dome = between(rng, 0.0, 0.03)
    profile = [(radius, 0.0), (radius, plate * 0.6), (radius * 0.6, plate + dome * 0.3), (0.04, plate + dome)]
    column = between(rng, 0.02, 0.045)
    return [
        lathe(profile, (0.0, 0.0, 0.0), "base", 20),
        cylinder(column, (0.0, plate * 0.5, 0.0), (0.0, height, 0.0), "column", 14),
    ]


def tulip_base(rng: np.random.Generator, height: float, radius: float) -> list[Part]:
    """Build one flowing foot and stem."""
    neck = between(rng, 0.025, 0.06)
    waist = between(rng, 0.3, 0.65) * height
    t = np.linspace(0.0, 1.0, 7)
    low = [(neck + (radius - neck) * (1.0 - s) ** 2.4, 0.012 + waist * s**0.8) for s in t]
    high = [
        (neck + (radius * 0.55 - neck) * s**2, waist + 0.012 + (height - waist - 0.012) * s) for s in (0.4, 0.7, 1.0)
    ]
    # Three pieces, so that the boxes of foot, neck and stem are not one block.
    pieces = ([(radius, 0.0), *low[:3]], low[2:], [low[-1], *high])
    return [lathe(piece, (0.0, 0.0, 0.0), "base", 20) for piece in pieces]


def cross_base(rng: np.random.Generator, height: float, radius: float) -> list[Part]:
    """Build four flat or raised arms about a column."""
    thick = between(rng, 0.025, 0.045)
    top = between(rng, 0.0, 0.12) if happens(rng, 0.5) else 0.0
    parts = [
        cylinder(
            between(rng, 0.022, 0.045), (0.0, 0.0 if top == 0 else top * 0.7, 0.0), (0.0, height, 0.0), "column", 12
        )
    ]
    for k in range(4):
        angle = np.radians(45.0 + 90.0 * k)
        out = np.array([np.sin(angle), 0.0, np.cos(angle)]) * radius
        start = np.array([0.0, top + thick / 2.0, 0.0])
        parts.append(beam(start, out + np.array([0.0, thick / 2.0, 0.0]), thick * 1.4, thick, "spoke"))
    return parts


def pedestal_base(rng: np.random.Generator, height: float, width: float) -> list[Part]:
    """Build one of the bases with a single stem."""
    kind = pick(rng, (tulip_base, disc_base, cross_base))
    return kind(rng, height, width * between(rng, 0.4, 0.6))


def cantilever_tube(
    rng: np.random.Generator, width: float, depth: float, height: float, back: list[np.ndarray] | None
) -> list[Part]:
    """Build a bent tube: seat rails, down the front, back along the floor; `back` continues the right rail upwards.

    `width` is between the tubes' center lines, `height` that of the seat rails.
    """
    r = between(rng, 0.011, 0.018)
    flat = happens(rng, 0.3)
    section = rounded_rectangle(2.2 * r, 1.6 * r, 0.3 * r, 1) if flat else ellipse(2.0 * r, 2.0 * r, 8)
    x, front, rear = width / 2.0, depth / 2.0, -depth / 2.0
    forward = between(rng, 0.0, 0.05)
    start = [] if back is None else [point for point in back]
    reach = rear * between(rng, 0.9, 1.1)
    side = [
        *start,
        np.array([x, height, rear]),
        np.array([x, height, front]),
        np.array([x, r, front + forward]),
        np.array([x, r, reach]),
    ]
    bend = between(rng, 0.04, 0.1)
    parts = []
    for sign in (1.0, -1.0):
        flip = np.array([sign, 1.0, 1.0])
        parts.append(sweep(section, rounded_path([p * flip for p in side], bend, 4), "frame"))
    parts.append(cylinder(r, (-x, r, reach + r), (x, r, reach + r), "frame", 8))
    if happens(rng, 0.5):
        z = between(rng, -0.3, 0.3) * depth
        parts.append(cylinder(r * 0.9, (-x, height, z), (x, height, z), "frame", 8))
    return parts


def sled_base(rng: np.random.Generator, width: float, depth: float, height: float) -> list[Part]:
    """Build two closed side loops of tube or bar on the floor, with cross bars below the seat."""
    r = between(rng, 0.009, 0.02)
    section = ellipse(2.0 * r, 2.0 * r, 8) if happens(rng, 0.6) else rounded_rectangle(2.4 * r, 2.0 * r, 0.0)
    x, z = width / 2.0 - r, depth / 2.0 - r
    lean_front, lean_back = between(rng, -0.02, 0.06), between(rng, -0.02, 0.1)
    corners = [
        (0.0, height, z - 0.02),
        (0.0, r, z - 0.02 + lean_front),
        (0.0, r, -z - lean_back),
        (0.0, height, -z + 0.02),
    ]
    out = between(rng, 0.0, 0.04)
    bend = between(rng, 0.01, 0.08)
    parts = []
    for sign in (-1.0, 1.0):
        path = rounded_path([(sign * (x + (out if y <= r else 0.0)), y, w) for _, y, w in corners], bend, 4)
        parts.append(sweep(section, path, "frame"))
    for place in (z - 0.03, -z + 0.03):
        parts.append(cylinder(r, (-x, height - r, place), (x, height - r, place), "frame", 8))
    return parts


def crossed_legs(rng: np.random.Generator, width: float, depth: float, height: float) -> list[Part]:
    """Build two legs crossing at each side, tied across: folding chairs and stools."""
    t = between(rng, 0.02, 0.035)
    x, z = width / 2.0 - t / 2.0, depth / 2.0 - t
    parts = []
    for sign in (-1.0, 1.0):
        outer, inner = sign * x, sign * (x - t)
        parts.append(beam((outer, t * 0.4, -z), (outer, height, z), t, t * 1.3, "leg"))
        parts.append(beam((inner, t * 0.4, z), (inner, height, -z), t, t * 1.3, "leg"))
    fraction = between(rng, 0.1, 0.3)
    for place, far in ((z, 1.0), (-z, 1.0)):
        y = height * fraction
        w = place * (1.0 - 2.0 * fraction) * far
        parts.append(cylinder(t * 0.35, (-x, y, w), (x, y, w), "stretcher", 8))
    for place in (z * 0.96, -z * 0.96):
        parts.append(cylinder(t * 0.45, (-x, height * 0.98, place), (x, height * 0.98, place), "stretcher", 8))
    return parts


def side_panels(rng: np.random.Generator, width: float, depth: float, height: float) -> list[Part]:
    """Build two full boards as legs, perhaps tied at the back."""
    t = between(rng, 0.018, 0.05)
    x = width / 2.0 - t / 2.0
    parts = [box((t, height, depth), (s * x, height / 2.0, 0.0), "leg") for s in (-1.0, 1.0)]
    if happens(rng, 0.5):
        tall = height * between(rng, 0.2, 0.8)
        parts.append(
            box((width - t, tall, t), (0.0, height - tall / 2.0, between(rng, -0.4, 0.0) * depth), "stretcher")
        )
    return parts


def trestle_legs(rng: np.random.Generator, width: float, depth: float, height: float) -> list[Part]:
    """Build two end frames, shaped like an A or a T, tied by a long bar: benches."""
    t = between(rng, 0.04, 0.07)
    parts = []
    upright = happens(rng, 0.5)
    for s in (-1.0, 1.0):
        x = s * width * 0.38
        if upright:
            parts.append(box((t, height, t * 1.5), (x, height / 2.0, 0.0), "leg"))
            parts.append(box((t, t, depth * 0.9), (x, t / 2.0, 0.0), "leg"))
        else:
            for z in (-1.0, 1.0):
                foot, head = (x, 0.0, z * depth * 0.45), (x, height, z * depth * 0.25)
                parts.append(frustum((t, t), (t, t), foot, head, "leg"))
        parts.append(box((t, t * 0.8, depth * 0.85), (x, height - t * 0.4, 0.0), "leg"))
        if not upright:
            y = height * 0.5
            parts.append(box((t * 0.7, t * 0.8, depth * 0.7), (x, y, 0.0), "stretcher"))
    parts.append(box((width * 0.76, t, t * 0.7), (0.0, height * 0.5, 0.0), "stretcher"))
    return parts


def rocker_runners(rng: np.random.Generator, feet: np.ndarray, length: float) -> list[Part]:
    """Build two curved runners through pairs of leg feet (4, 3) in the order of `Legs`."""
    radius = between(rng, 0.7, 1.3)
    tall, wide = between(rng, 0.03, 0.05), between(rng, 0.025, 0.04)
    section = np.array([[1, 1], [-1, 1], [-1, -1], [1, -1]]) / 2.0 * np.array([wide, tall])
    parts = []
    for i in (0, 1):
        front, rear = feet[i], feet[i + 2]
        middle = (front[2] + rear[2]) / 2.0 - length * 0.06
        reach = np.linspace(length / 2.0, -length / 2.0, whole(rng, 12, 12) + 1)
        half = (front[2] - rear[2]) / 2.0
        base = float(front[1]) - (radius - np.sqrt(radius**2 - half**2))
        path = np.column_stack(
            [
                np.interp(middle + reach, [rear[2], front[2]], [rear[0], front[0]]),
                base + radius - np.sqrt(radius**2 - reach**2),
                middle + reach,
            ]
        )
        parts.append(sweep(section, path, "rocker"))
    return parts
