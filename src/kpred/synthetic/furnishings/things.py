"""Families of bins, boxes, plants, vases, screens and pianos."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from kpred.synthetic.chance import between, happens, pick, whole
from kpred.synthetic.organic import vessel
from kpred.synthetic.others.household import open_box, piano
from kpred.synthetic.others.nature import potted_plant, tree
from kpred.synthetic.parts import Part, box, cushion, cylinder, ellipse, frustum, lathe, rounded_rectangle, slab

Family = Callable[[np.random.Generator], list[Part]]


def open_bin(rng: np.random.Generator) -> list[Part]:
    """Build an open waste basket, round or square, narrower below."""
    height, radius = between(rng, 0.24, 0.45), between(rng, 0.11, 0.2)
    foot, long = radius * between(rng, 0.65, 1.0), pick(rng, (1.0, 1.0, between(rng, 1.2, 1.7)))
    square = happens(rng, 0.45)
    plans = [
        rounded_rectangle(2 * r * long, 2 * r, between(rng, 0.02, 0.5) * r, 3) if square else ellipse(2 * r, 2 * r, 24)
        for r in (foot, radius)
    ]
    parts = [vessel(plans, [0.0, height], 0.008, "bin")]
    if happens(rng, 0.4) and not square:
        parts.append(
            lathe(
                [(radius - 0.01, 0), (radius + 0.008, 0.004), (radius + 0.008, 0.02), (radius - 0.01, 0.02)],
                (0, height - 0.02, 0),
                "rim",
                24,
            )
        )
    return parts


def pedal_bin(rng: np.random.Generator) -> list[Part]:
    """Build a closed bin with a lid and a pedal in front."""
    height, radius = between(rng, 0.3, 0.7), between(rng, 0.12, 0.2)
    lid = between(rng, 0.04, 0.1)
    pedal = box((0.06, 0.012, 0.06), (0, 0.02, radius + 0.02), "pedal")
    if happens(rng, 0.6):
        body = lathe([(radius, 0), (radius, height - lid)], (0, 0, 0), "bin", 24)
        top = lathe(
            [(radius + 0.004, 0), (radius, 0.4 * lid), (0.6 * radius, lid)], (0, height - lid + 0.003, 0), "lid", 24
        )
        return [body, top, pedal]
    wide = radius * between(rng, 1.0, 1.5)
    body = cushion((2 * wide, height - lid, 2 * radius), (0, (height - lid) / 2, 0), "bin", 0.02, 2)
    return [body, box((2 * wide, lid, 2 * radius + 0.01), (0, height - lid / 2 + 0.003, 0), "lid"), pedal]


def wheeled_bin(rng: np.random.Generator) -> list[Part]:
    """Build a large bin with a sloping lid, wheels and a grip behind."""
    width, depth, height = between(rng, 0.45, 0.6), between(rng, 0.5, 0.7), between(rng, 0.85, 1.05)
    parts = [frustum((0.78 * width, 0.7 * depth), (width, depth), (0, 0.04, 0.03), (0, height, 0), "bin")]
    lid = box((width + 0.03, 0.05, depth + 0.05), (0, 0, 0), "lid").rotated("x", between(rng, 0, 8))
    parts.append(lid.moved((0, height + 0.03, 0)))
    parts.append(
        cylinder(0.015, (-0.3 * width, height, -depth / 2 - 0.05), (0.3 * width, height, -depth / 2 - 0.05), "grip", 8)
    )
    parts += [
        cylinder(0.1, (s * 0.36 * width, 0.1, -0.36 * depth), (s * 0.46 * width, 0.1, -0.36 * depth), "wheel", 14)
        for s in (-1, 1)
    ]
    return parts


def swing_bin(rng: np.random.Generator) -> list[Part]:
    """Build a tall bin with a roof-like swinging lid."""
    width, depth, height = between(rng, 0.26, 0.42), between(rng, 0.24, 0.36), between(rng, 0.45, 0.8)
    body = frustum((0.85 * width, 0.85 * depth), (width, depth), (0, 0, 0), (0, 0.75 * height, 0), "bin")
    roof = frustum(
        (width + 0.01, depth + 0.01), (0.6 * width, 0.15 * depth), (0, 0.75 * height, 0), (0, height, 0), "lid"
    )
    return [body, roof]


def closed_box(rng: np.random.Generator) -> list[Part]:
    """Build a plain closed box, perhaps with a taller lid or tape."""
    size = (between(rng, 0.15, 0.8), between(rng, 0.1, 0.6), between(rng, 0.15, 0.6))
    parts = [box(size, (0, size[1] / 2, 0), "box")]
    if happens(rng, 0.5):
        lid = size[1] * between(rng, 0.15, 0.4)
        parts.append(box((size[0] + 0.012, lid, size[2] + 0.012), (0, size[1] - lid / 2 + 0.004, 0), "lid"))
    return parts


def chest(rng: np.random.Generator) -> list[Part]:
    """Build a trunk with a flat or round lid and fittings."""
    width, height, depth = between(rng, 0.6, 1.2), between(rng, 0.25, 0.45), between(rng, 0.35, 0.55)
    parts = [box((width, height, depth), (0, height / 2, 0), "box")]
    if happens(rng, 0.5):
        angles = np.radians(np.linspace(0, 180, 11))
        rise = between(rng, 0.2, 0.5)
        outline = np.column_stack([np.cos(angles) * depth / 2, np.sin(angles) * depth / 2 * rise + 0.01])
        lid = slab(np.concatenate([outline, [[-depth / 2, 0], [depth / 2, 0]]]), 0, width, "lid")
        parts.append(lid.rotated("x", -90).rotated("y", 90).moved((-width / 2, height, 0)))
        low, high = parts[1].vertices.min(axis=0), parts[1].vertices.max(axis=0)
        parts[1] = parts[1].moved((-(low[0] + high[0]) / 2, height - low[1], -(low[2] + high[2]) / 2))
    else:
        parts.append(box((width + 0.02, 0.06, depth + 0.02), (0, height + 0.03, 0), "lid"))
    parts += [box((0.05, height, 0.01), (s * 0.3 * width, height / 2, depth / 2 + 0.004), "fitting") for s in (-1, 1)]
    return [*parts, box((0.08, 0.08, 0.02), (0, height - 0.04, depth / 2 + 0.008), "lock")]


def crate(rng: np.random.Generator) -> list[Part]:
    """Build an open crate of slats."""
    width, height, depth, rows = (
        between(rng, 0.3, 0.6),
        between(rng, 0.2, 0.4),
        between(rng, 0.25, 0.45),
        whole(rng, 2, 4),
    )
    parts = [box((width, 0.015, depth), (0, 0.008, 0), "bottom")]
    each = height / rows
    for k in range(rows):
        y = (k + 0.5) * each
        parts += [box((width, 0.75 * each, 0.012), (0, y, s * depth / 2), "slat") for s in (-1, 1)]
        parts += [box((0.012, 0.75 * each, depth), (s * width / 2, y, 0), "slat") for s in (-1, 1)]
    return parts + [
        box((0.03, height, 0.03), (a * (width / 2 - 0.02), height / 2, b * (depth / 2 - 0.02)), "post")
        for a in (-1, 1)
        for b in (-1, 1)
    ]


def vase(rng: np.random.Generator) -> list[Part]:
    """Build a hollow turned vase."""
    height = between(rng, 0.15, 0.7)
    radius, rows = height * between(rng, 0.14, 0.4), np.linspace(0.0, 1.0, 12)
    swing = 0.62 + 0.38 * np.sin(between(rng, 2.0, 6.5) * rows + between(rng, 0.0, 3.0))
    outer = np.column_stack([radius * swing, height * rows])
    wall = 0.08 * radius
    inner = np.column_stack([np.maximum(outer[:0:-1, 0] - wall, 0.004), outer[:0:-1, 1]])
    return [lathe(np.concatenate([outer, inner]), (0, 0, 0), "vase", 24)]


def bowl(rng: np.random.Generator) -> list[Part]:
    """Build an open bowl on a small foot."""
    height, radius, power = between(rng, 0.06, 0.2), between(rng, 0.08, 0.22), between(rng, 0.35, 0.8)
    rows = np.linspace(0.08, 1.0, 8)
    outer = np.column_stack([radius * rows**power, height * rows])
    inner = np.column_stack([np.maximum(outer[::-1, 0] - 0.008, 0.004), outer[::-1, 1] + 0.004])
    return [lathe(np.concatenate([[(0.4 * radius, 0)], outer, inner]), (0, 0, 0), "vase", 24)]


def flat_screen(rng: np.random.Generator) -> list[Part]:
    """Build a monitor or television on a foot, two feet, or none."""
    width = between(rng, 0.4, 0.75) if happens(rng, 0.5) else between(rng, 0.75, 1.6)
    height, thick = width * between(rng, 0.54, 0.68), between(rng, 0.015, 0.07)
    stand, lift = pick(rng, ("neck", "neck", "feet", "none")), between(rng, 0.03, 0.16)
    lift = 0.0 if stand == "none" else lift
    panel = [box((width, height, thick), (0, height / 2, 0), "screen")]
    if happens(rng, 0.5):
        panel.append(
            box((0.6 * width, 0.55 * height, between(rng, 0.02, 0.06)), (0, 0.45 * height, -thick / 2 - 0.015), "back")
        )
    tilt = 0.0 if stand != "neck" else between(rng, 0, 10)
    parts = [part.rotated("x", -tilt).moved((0, lift, 0)) for part in panel]
    if stand == "neck":
        parts.append(
            box((0.12 * width, lift + 0.3 * height, 0.025), (0, (lift + 0.3 * height) / 2, -thick / 2 - 0.04), "neck")
        )
        round_foot, reach = happens(rng, 0.5), between(rng, 0.3, 0.6) * width
        plan = ellipse(reach, 0.22, 20) if round_foot else rounded_rectangle(reach, 0.2, 0.02, 2)
        parts.append(slab(plan, 0, 0.015, "foot").moved((0, 0, -0.03)))
    elif stand == "feet":
        parts += [box((0.025, 0.012, 0.22), (s * 0.36 * width, 0.006, 0), "foot") for s in (-1, 1)]
        parts += [box((0.025, lift + 0.02, 0.025), (s * 0.36 * width, (lift + 0.02) / 2, 0), "foot") for s in (-1, 1)]
    return parts


def tube_screen(rng: np.random.Generator) -> list[Part]:
    """Build an old deep screen, narrower behind."""
    width, ratio, deep = between(rng, 0.32, 0.8), between(rng, 0.72, 0.9), between(rng, 0.3, 0.5)
    height = width * ratio
    front = box((width, height, 0.3 * deep), (0, height / 2, 0.15 * deep), "screen")
    back = frustum((width * 0.95, height * 0.95), (0.55 * width, 0.55 * height), (0, 0, 0), (0, 0.7 * deep, 0), "back")
    back = back.rotated("x", -90).moved((0, height / 2, 0))
    lift = between(rng, 0.02, 0.06) if happens(rng, 0.5) else 0.0
    parts = [part.moved((0, lift, 0)) for part in (front, back)]
    if lift:
        parts.append(cylinder(0.3 * width, (0, 0, 0), (0, lift + 0.01, 0), "foot", 18))
    return parts


def laptop(rng: np.random.Generator) -> list[Part]:
    """Build an open portable computer."""
    width, depth = between(rng, 0.28, 0.4), between(rng, 0.2, 0.27)
    lid = box((width, depth, 0.008), (0, depth / 2, 0), "screen").rotated("x", -between(rng, 0, 35))
    return [box((width, 0.018, depth), (0, 0.009, 0), "base"), lid.moved((0, 0.018, -depth / 2))]


BIN_FAMILIES: dict[str, Family] = {
    "open_bin": open_bin,
    "pedal_bin": pedal_bin,
    "wheeled_bin": wheeled_bin,
    "swing_bin": swing_bin,
}
BOX_FAMILIES: dict[str, Family] = {"closed_box": closed_box, "carton": open_box, "chest": chest, "crate": crate}
PLANT_FAMILIES: dict[str, Family] = {"potted_plant": potted_plant, "small_tree": tree}
VASE_FAMILIES: dict[str, Family] = {"vase": vase, "bowl": bowl}
DISPLAY_FAMILIES: dict[str, Family] = {"flat_screen": flat_screen, "tube_screen": tube_screen, "laptop": laptop}
PIANO_FAMILIES: dict[str, Family] = {"piano": piano}
