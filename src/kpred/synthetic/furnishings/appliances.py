"""Families of fridges, washing machines and dishwashers: bodies with fronts at +z."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from kpred.synthetic.chance import between, happens, pick
from kpred.synthetic.organic import ring
from kpred.synthetic.part import Number
from kpred.synthetic.parts import Part, box, cushion, cylinder, ellipse, frustum, lathe, sweep
from kpred.synthetic.paths import rounded_path

Family = Callable[[np.random.Generator], list[Part]]


def _feet(width: Number, depth: Number, height: Number) -> list[Part]:
    return [
        cylinder(
            0.02,
            (a * (width / 2 - 0.05), 0, b * (depth / 2 - 0.05)),
            (a * (width / 2 - 0.05), height + 0.005, b * (depth / 2 - 0.05)),
            "foot",
            8,
        )
        for a in (-1, 1)
        for b in (-1, 1)
    ]


def bar_handle(
    rng: np.random.Generator, start: tuple[Number, Number], end: tuple[Number, Number], face: Number
) -> list[Part]:
    """Build a bar before a front at z = `face`, from (x, y) to (x, y), or nothing for a recessed grip."""
    if happens(rng, 0.15):
        return []
    out = between(rng, 0.03, 0.06)
    path = [(*start, face - 0.005), (*start, face + out), (*end, face + out), (*end, face - 0.005)]
    return [sweep(ellipse(0.018, 0.018, 6), rounded_path(path, 0.02), "handle")]


def _door(x: Number, low: Number, high: Number, width: Number, face: Number, thick: Number, soft: bool) -> Part:
    size, middle = (width - 0.006, high - low - 0.006, thick), (x, (low + high) / 2, face + thick / 2)
    return cushion(size, middle, "door", 0.015, 2) if soft else box(size, middle, "door")


def _fridge(rng: np.random.Generator, width: Number, height: Number, rows: list[float], columns: int) -> list[Part]:
    """Build a body with doors over each other at the heights `rows` (fractions), the topmost in `columns`."""
    depth, feet, thick = between(rng, 0.5, 0.7), between(rng, 0.01, 0.06), between(rng, 0.03, 0.07)
    soft = happens(rng, 0.4)
    parts = [box((width, height - feet, depth), (0, (height + feet) / 2, 0), "body"), *_feet(width, depth, feet)]
    edges = [feet + (height - feet) * f for f in (0.0, *rows, 1.0)]
    face = depth / 2
    side = pick(rng, (-1, 1))
    for number, (low, high) in enumerate(zip(edges[:-1], edges[1:], strict=True)):
        top = number == len(edges) - 2
        count = columns if top else 1
        for k in range(count):
            x = ((k + 0.5) / count - 0.5) * width
            parts.append(_door(x, low, high, width / count, face, thick, soft))
            if count == 2:
                parts += bar_handle(
                    rng,
                    (x + (0.5 - k) * 0.75 * width / 2 * 1.1, low + 0.2 * (high - low)),
                    (x + (0.5 - k) * 0.75 * width / 2 * 1.1, high - 0.2 * (high - low)),
                    face + thick,
                )
            elif high - low < 0.5 and not top:
                parts += bar_handle(rng, (-0.3 * width, high - 0.08), (0.3 * width, high - 0.08), face + thick)
            else:
                reach = min(0.35, 0.6 * (high - low))
                start = low + 0.2 * (high - low) if top and len(edges) > 2 else high - 0.1 - reach
                parts += bar_handle(
                    rng, (side * 0.42 * width, start), (side * 0.42 * width, start + reach), face + thick
                )
    return parts


def one_door_fridge(rng: np.random.Generator) -> list[Part]:
    """Build a tall or counter-high fridge with one door."""
    return _fridge(rng, between(rng, 0.5, 0.62), between(rng, 0.8, 1.8), [], 1)


def two_door_fridge(rng: np.random.Generator) -> list[Part]:
    """Build a fridge with a freezer above or below."""
    return _fridge(
        rng,
        between(rng, 0.54, 0.75),
        between(rng, 1.4, 2.0),
        [pick(rng, (between(rng, 0.3, 0.4), between(rng, 0.62, 0.75)))],
        1,
    )


def side_by_side(rng: np.random.Generator) -> list[Part]:
    """Build a wide fridge with two upright doors, perhaps over drawers."""
    rows = [] if happens(rng, 0.5) else sorted({0.3, *([0.15] if happens(rng, 0.4) else [])})
    return _fridge(rng, between(rng, 0.83, 0.98), between(rng, 1.7, 1.95), list(rows), 2)


def small_fridge(rng: np.random.Generator) -> list[Part]:
    """Build a box-sized fridge, perhaps with a round top edge."""
    return _fridge(rng, between(rng, 0.42, 0.55), between(rng, 0.45, 0.85), [] if happens(rng, 0.7) else [0.72], 1)


def chest_freezer(rng: np.random.Generator) -> list[Part]:
    """Build a low chest with a lid on top."""
    width, depth, height, lid = (
        between(rng, 0.6, 1.5),
        between(rng, 0.55, 0.72),
        between(rng, 0.8, 0.92),
        between(rng, 0.06, 0.12),
    )
    parts = [box((width, height - lid, depth), (0, (height - lid) / 2, 0), "body")]
    parts.append(cushion((width + 0.01, lid, depth + 0.02), (0, height - lid / 2, 0), "lid", 0.03, 2))
    return [*parts, box((0.16, 0.03, 0.04), (0, height - 0.6 * lid, depth / 2 + 0.02), "handle")]


def front_loader(rng: np.random.Generator) -> list[Part]:
    """Build a washing machine or dryer with a round door."""
    width, height, depth = between(rng, 0.57, 0.68), between(rng, 0.8, 0.95), between(rng, 0.48, 0.68)
    feet, face, panel = 0.015, depth / 2, between(rng, 0.09, 0.14)
    radius = between(rng, 0.14, 0.21)
    middle = (0, feet + (height - panel) * between(rng, 0.48, 0.56), face)
    parts = [box((width, height - feet, depth), (0, (height + feet) / 2, 0), "body"), *_feet(width, depth, feet)]
    parts.append(ring(radius, between(rng, 0.03, 0.05), middle, "door"))
    bulge = between(rng, 0.0, 0.05)
    glass = lathe([(radius, 0), (0.75 * radius, 0.015), (0.5 * radius, 0.015 + bulge)], (0, 0, 0), "door", 20)
    parts.append(glass.rotated("x", 90).moved(middle))
    parts.append(box((width, panel, 0.015), (0, height - panel / 2 - 0.01, face + 0.006), "panel"))
    parts.append(
        cylinder(
            0.03,
            (between(rng, -0.05, 0.15), height - panel / 2, face),
            (0.1, height - panel / 2, face + 0.035),
            "knob",
            14,
        )
    )
    if happens(rng, 0.6):
        parts.append(
            box((0.3 * width, 0.7 * panel, 0.02), (-0.32 * width, height - panel / 2 - 0.01, face + 0.01), "drawer")
        )
    return parts


def top_loader(rng: np.random.Generator) -> list[Part]:
    """Build a washing machine with a lid on top and a panel behind it."""
    width, height, depth, rise = (
        between(rng, 0.45, 0.7),
        between(rng, 0.85, 0.98),
        between(rng, 0.55, 0.68),
        between(rng, 0.06, 0.18),
    )
    parts = [box((width, height, depth), (0, height / 2, 0), "body")]
    parts.append(box((0.86 * width, 0.02, 0.66 * depth), (0, height + 0.008, 0.1 * depth), "lid"))
    parts.append(
        frustum(
            (width, 0.16),
            (width, 0.09),
            (0, height, -depth / 2 + 0.08),
            (0, height + rise, -depth / 2 + 0.045),
            "panel",
        )
    )
    return parts


def dishwasher(rng: np.random.Generator) -> list[Part]:
    """Build a counter-high or small body with one flat door, a bar and a panel."""
    width, height, depth = (
        pick(rng, (0.45, 0.6)) + between(rng, -0.02, 0.02),
        between(rng, 0.8, 0.9),
        between(rng, 0.55, 0.65),
    )
    return _cabinet_machine(rng, width, height, depth, between(rng, 0.06, 0.12))


def table_dishwasher(rng: np.random.Generator) -> list[Part]:
    """Build a low dishwasher that stands on a table."""
    return _cabinet_machine(rng, between(rng, 0.5, 0.58), between(rng, 0.42, 0.6), between(rng, 0.45, 0.55), 0.03)


def _cabinet_machine(
    rng: np.random.Generator, width: Number, height: Number, depth: Number, plinth: Number
) -> list[Part]:
    face, panel, thick = depth / 2, between(rng, 0.08, 0.14), between(rng, 0.02, 0.05)
    parts = [box((width, height - plinth, depth), (0, (height + plinth) / 2, 0), "body")]
    parts.append(box((width * 0.98, plinth + 0.004, depth - 0.1), (0, plinth / 2, -0.05), "plinth"))
    door_top = height - panel if happens(rng, 0.7) else height - 0.02
    door = _door(0, plinth, door_top, width, face, thick, happens(rng, 0.3))
    if happens(rng, 0.15):
        parts.append(door.rotated("x", between(rng, 30, 88), (0, plinth, face)))
        return parts
    parts.append(door)
    if door_top < height - 0.03:
        parts.append(
            box(
                (width, panel - 0.01, thick * between(rng, 0.6, 1.2)),
                (0, height - panel / 2, face + thick / 2),
                "panel",
            )
        )
    return parts + bar_handle(rng, (-0.38 * width, door_top - 0.06), (0.38 * width, door_top - 0.06), face + thick)


FRIDGE_FAMILIES: dict[str, Family] = {
    "one_door_fridge": one_door_fridge,
    "two_door_fridge": two_door_fridge,
    "side_by_side": side_by_side,
    "small_fridge": small_fridge,
    "chest_freezer": chest_freezer,
}
WASHING_FAMILIES: dict[str, Family] = {"front_loader": front_loader, "top_loader": top_loader}
DISHWASHER_FAMILIES: dict[str, Family] = {"dishwasher": dishwasher, "table_dishwasher": table_dishwasher}
