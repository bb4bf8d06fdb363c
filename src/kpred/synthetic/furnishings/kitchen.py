"""Families of ovens, hoods, microwaves and toasters, fronts at +z."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from kpred.synthetic.chance import between, happens, pick, whole
from kpred.synthetic.furnishings.appliances import bar_handle
from kpred.synthetic.organic import vessel
from kpred.synthetic.part import Number
from kpred.synthetic.parts import Part, box, cylinder, frustum, rounded_rectangle

Family = Callable[[np.random.Generator], list[Part]]


def _knobs(rng: np.random.Generator, count: int, width: Number, y: Number, face: Number) -> list[Part]:
    radius = between(rng, 0.014, 0.024)
    xs = (np.arange(count) - (count - 1) / 2) * width / count
    return [cylinder(radius, (x, y, face - 0.002), (x, y, face + 0.03), "knob", 10) for x in xs]


def cooker(rng: np.random.Generator) -> list[Part]:
    """Build a stove: an oven door below, knobs, and plates or grates on top."""
    width, height, depth = pick(rng, (0.5, 0.6, 0.6, 0.76, 0.9)), between(rng, 0.85, 0.94), between(rng, 0.58, 0.68)
    face, panel = depth / 2, between(rng, 0.08, 0.14)
    drawer = between(rng, 0.08, 0.22)
    parts = [box((width, height, depth), (0, height / 2, 0), "body")]
    parts.append(
        box(
            (width - 0.01, height - panel - drawer - 0.02, 0.035),
            (0, (height - panel + drawer) / 2, face + 0.017),
            "door",
        )
    )
    parts.append(box((width - 0.01, drawer - 0.05, 0.03), (0, drawer / 2 + 0.02, face + 0.015), "drawer"))
    parts += bar_handle(rng, (-0.4 * width, height - panel - 0.06), (0.4 * width, height - panel - 0.06), face + 0.035)
    parts += _knobs(rng, whole(rng, 4, 7), 0.9 * width, height - panel / 2, face)
    for x in (-0.23, 0.23):
        for z in (-0.2, 0.2):
            size = between(rng, 0.07, 0.1)
            if happens(rng, 0.5):
                parts.append(
                    cylinder(size, (x * width, height, z * depth), (x * width, height + 0.015, z * depth), "plate", 16)
                )
            else:
                parts += [
                    box(
                        (2 * size if t else 0.012, 0.02, 0.012 if t else 2 * size),
                        (x * width, height + 0.012, z * depth),
                        "grate",
                    )
                    for t in (0, 1)
                ]
    if happens(rng, 0.4):
        rise = between(rng, 0.06, 0.25)
        parts.append(box((width, rise, 0.05), (0, height + rise / 2, -depth / 2 + 0.025), "panel"))
    return parts


def built_in_oven(rng: np.random.Generator) -> list[Part]:
    """Build an oven alone: a door with a window under a panel, once or twice."""
    width, depth, each = between(rng, 0.55, 0.62), between(rng, 0.5, 0.6), between(rng, 0.42, 0.62)
    parts, face = [], depth / 2
    for k in range(2 if happens(rng, 0.2) else 1):
        low, panel = k * each, between(rng, 0.08, 0.12)
        parts.append(box((width, each - 0.005, depth), (0, low + each / 2, 0), "body"))
        parts.append(box((width, each - panel - 0.02, 0.03), (0, low + (each - panel) / 2, face + 0.015), "door"))
        parts.append(
            box((0.7 * width, 0.5 * (each - panel), 0.006), (0, low + 0.42 * (each - panel), face + 0.032), "window")
        )
        parts += bar_handle(
            rng, (-0.38 * width, low + each - panel - 0.07), (0.38 * width, low + each - panel - 0.07), face + 0.03
        )
        parts += _knobs(rng, whole(rng, 2, 4), 0.7 * width, low + each - panel / 2, face)
    return parts


def hood(rng: np.random.Generator) -> list[Part]:
    """Build an extractor hood: a canopy and a shaft on the wall (at -z)."""
    width, depth, tall = between(rng, 0.55, 0.95), between(rng, 0.42, 0.55), between(rng, 0.05, 0.3)
    high, shaft = tall + between(rng, 0.3, 0.7), between(rng, 0.2, 0.32)
    parts = [box((width, 0.05, depth), (0, 0.025, 0), "rim")]
    parts.append(
        frustum((width, depth), (shaft, shaft), (0, 0.05, 0), (0, 0.05 + tall, -depth / 2 + shaft / 2), "canopy")
    )
    return [*parts, box((shaft, high - tall, shaft), (0, (high + tall) / 2 + 0.04, -depth / 2 + shaft / 2), "shaft")]


def microwave(rng: np.random.Generator) -> list[Part]:
    """Build a low body with a door at its left and a panel of keys or knobs at its right."""
    width, height, depth = between(rng, 0.42, 0.58), between(rng, 0.24, 0.34), between(rng, 0.3, 0.45)
    face, split, foot = depth / 2, between(rng, 0.66, 0.8), 0.012
    parts = [box((width, height - foot, depth), (0, (height + foot) / 2, 0), "body")]
    parts += [
        box((0.04, foot + 0.003, 0.04), (a * 0.4 * width, foot / 2, b * 0.4 * depth), "foot")
        for a in (-1, 1)
        for b in (-1, 1)
    ]
    wide = split * width
    middle = ((wide - width) / 2, (height + foot) / 2, face + 0.012)
    door = box((wide - 0.006, height - foot - 0.006, 0.024), middle, "door")
    if happens(rng, 0.15):
        parts.append(door.rotated("y", -between(rng, 30, 100), (-width / 2, 0, face)))
    else:
        parts += [door, box((0.7 * wide, 0.62 * height, 0.004), (middle[0] - 0.02, middle[1], face + 0.025), "window")]
        x = wide - width / 2 - 0.03
        parts += bar_handle(rng, (x, foot + 0.15 * height), (x, 0.88 * height), face + 0.024)
    x = width / 2 - (1 - split) * width / 2
    if happens(rng, 0.5):
        parts += [cylinder(0.022, (x, height * f, face), (x, height * f, face + 0.03), "knob", 12) for f in (0.3, 0.65)]
    else:
        parts += [
            box((0.02, 0.012, 0.008), (x + (i - 1) * 0.025, height * (0.2 + 0.1 * j), face + 0.004), "key")
            for i in range(3)
            for j in range(4)
        ]
        parts.append(box((0.07, 0.03, 0.006), (x, 0.8 * height, face + 0.003), "display"))
    return parts


def toaster(rng: np.random.Generator) -> list[Part]:
    """Build a rounded body with slots on top and a lever at one end (+x)."""
    length, height, depth = between(rng, 0.24, 0.4), between(rng, 0.16, 0.21), between(rng, 0.14, 0.26)
    plan = rounded_rectangle(length, depth, between(rng, 0.02, 0.06), 3)
    parts = [vessel([plan * 0.97, plan, plan * 0.97], [0.01, 0.3 * height, height], 0.012, "body")]
    count = 1 if depth < 0.18 else 2
    bars = np.linspace(-0.36, 0.36, count + 1) * depth
    parts += [box((0.9 * length, 0.02, 0.22 * depth / count), (0, height - 0.012, z), "bridge") for z in bars]
    parts.append(box((0.03, 0.02, 0.05), (length / 2 + 0.01, height * between(rng, 0.5, 0.8), 0), "lever"))
    return [*parts, cylinder(0.015, (length / 2 - 0.01, 0.06, 0), (length / 2 + 0.015, 0.06, 0), "knob", 10)]


OVEN_FAMILIES: dict[str, Family] = {"cooker": cooker, "built_in_oven": built_in_oven}
HOOD_FAMILIES: dict[str, Family] = {"hood": hood}
MICROWAVE_FAMILIES: dict[str, Family] = {"microwave": microwave}
TOASTER_FAMILIES: dict[str, Family] = {"toaster": toaster}
