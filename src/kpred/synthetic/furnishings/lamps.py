"""Families of lamps: on the floor, on tables, below ceilings, on walls."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from kpred.synthetic.chance import between, happens, pick, whole
from kpred.synthetic.organic import ellipsoid
from kpred.synthetic.others.household import desk_lamp
from kpred.synthetic.part import Number
from kpred.synthetic.parts import Part, box, cylinder, ellipse, frustum, lathe, slab, sweep
from kpred.synthetic.paths import bezier, rounded_path

Family = Callable[[np.random.Generator], list[Part]]

WALL = 0.006
"""Thickness of shades, metres."""


def shade(rng: np.random.Generator, radius: Number, height: Number, bottom: Number, label: str = "shade") -> Part:
    """Build a hollow cone, drum or bell that is open below."""
    top = radius * pick(rng, (between(rng, 0.25, 0.6), between(rng, 0.6, 1.0)))
    bend = between(rng, -0.12, 0.12) * radius if happens(rng, 0.3) else 0.0
    rows = np.linspace(0.0, 1.0, 5)
    outer = np.column_stack([radius + (top - radius) * rows - 4 * bend * rows * (1 - rows), rows * height])
    inner = np.column_stack([np.maximum(outer[::-1, 0] - WALL, 0.004), np.minimum(outer[::-1, 1], height - WALL)])
    return lathe(np.concatenate([outer, inner]), (0.0, bottom, 0.0), label, 20)


def _foot(rng: np.random.Generator, radius: Number) -> list[Part]:
    style = pick(rng, ("disc", "dome", "square"))
    if style == "square":
        return [box((1.7 * radius, 0.025, 1.7 * radius), (0, 0.0125, 0), "base")]
    high = 0.025 if style == "disc" else 0.3 * radius
    return [
        lathe(
            [(radius, 0), (radius, 0.012), (0.6 * radius, 0.012 + 0.6 * high), (0.015, 0.012 + high)],
            (0, 0, 0),
            "base",
            20,
        )
    ]


def floor_lamp(rng: np.random.Generator) -> list[Part]:
    """Build a foot, a pole and a shade around its top."""
    height, tall = between(rng, 1.3, 1.85), between(rng, 0.18, 0.4)
    pole = between(rng, 0.008, 0.02)
    parts = [*_foot(rng, between(rng, 0.11, 0.2)), cylinder(pole, (0, 0.01, 0), (0, height - 0.3 * tall, 0), "pole", 8)]
    if happens(rng, 0.3):
        parts.append(slab(ellipse(0.4, 0.4, 20), between(rng, 0.45, 0.65), 0.015, "tray"))
    return [*parts, shade(rng, between(rng, 0.13, 0.27), tall, height - tall)]


def tripod_lamp(rng: np.random.Generator) -> list[Part]:
    """Build three legs that meet under a shade."""
    height, tall, reach = between(rng, 1.2, 1.75), between(rng, 0.2, 0.38), between(rng, 0.2, 0.35)
    hub, thick = height - tall * between(rng, 0.7, 1.2), between(rng, 0.01, 0.02)
    angles = np.radians([90.0, 210.0, 330.0])
    parts = [
        cylinder(thick, (reach * np.cos(a), 0, reach * np.sin(a)), (0.02 * np.cos(a), hub, 0.02 * np.sin(a)), "leg", 8)
        for a in angles
    ]
    parts.append(cylinder(0.03, (0, hub - 0.02, 0), (0, height - 0.4 * tall, 0), "pole", 10))
    return [*parts, shade(rng, between(rng, 0.18, 0.28), tall, height - tall)]


def arc_lamp(rng: np.random.Generator) -> list[Part]:
    """Build a heavy foot and a rod that bends over to a hanging shade in front."""
    height, reach = between(rng, 1.6, 2.2), between(rng, 0.7, 1.4)
    path = bezier((0, 0.03, -reach / 2), (0, 1.9 * height - 0.9, -0.35 * reach), (0, height - 0.35, reach / 2), 14)
    radius, tall = between(rng, 0.12, 0.24), between(rng, 0.14, 0.26)
    head = shade(rng, radius, tall, 0.0).moved(path[-1] - np.array([0, tall, 0]))
    foot = [part.moved((0, 0, -reach / 2)) for part in _foot(rng, between(rng, 0.15, 0.22))]
    return [*foot, sweep(ellipse(0.022, 0.022, 8), path, "rod"), head]


def torchiere(rng: np.random.Generator) -> list[Part]:
    """Build a pole with a bowl that opens upwards, perhaps with a reading arm."""
    height, radius = between(rng, 1.6, 1.95), between(rng, 0.12, 0.2)
    tall = between(rng, 0.08, 0.2)
    rows = [
        (0.02, 0),
        (0.7 * radius, 0.4 * tall),
        (radius, tall),
        (radius - WALL, tall),
        (0.65 * radius, 0.45 * tall),
        (0.015, 0.03),
    ]
    parts = [
        *_foot(rng, between(rng, 0.12, 0.18)),
        cylinder(0.012, (0, 0.01, 0), (0, height - tall + 0.01, 0), "pole", 8),
    ]
    parts.append(lathe(rows, (0, height - tall, 0), "shade", 20))
    if happens(rng, 0.4):
        low, out = between(rng, 1.0, 1.4), between(rng, 0.2, 0.35)
        parts.append(cylinder(0.008, (0, low, 0), (0, low + 0.08, out), "arm", 6))
        parts.append(cylinder(0.03, (0, low + 0.1, out), (0, low, out + 0.05), "head", 12, end_radius=0.07))
    return parts


def table_lamp(rng: np.random.Generator) -> list[Part]:
    """Build a turned or boxy body with a shade."""
    body, tall = between(rng, 0.18, 0.4), between(rng, 0.14, 0.28)
    wide = between(rng, 0.05, 0.12)
    style = pick(rng, ("turned", "turned", "ball", "block", "stick"))
    if style == "turned":
        rows = np.linspace(0.0, 1.0, 9)
        swing = 0.65 + 0.35 * np.sin(between(rng, 2.5, 6.0) * rows + between(rng, 0.0, 3.0))
        parts = [lathe(np.column_stack([wide * swing, body * rows]), (0, 0, 0), "base", 16)]
    elif style == "ball":
        parts = [*_foot(rng, 0.8 * wide), ellipsoid((wide, 0.42 * body, wide), (0, 0.5 * body, 0), "base")]
    elif style == "block":
        parts = [frustum((2 * wide, 2 * wide), (1.4 * wide, 1.4 * wide), (0, 0, 0), (0, body, 0), "base")]
    else:
        parts = [*_foot(rng, wide), cylinder(0.01, (0, 0.01, 0), (0, body, 0), "pole", 8)]
    parts.append(cylinder(0.008, (0, 0.9 * body, 0), (0, body + 0.6 * tall, 0), "pole", 8))
    return [*parts, shade(rng, between(rng, 0.1, 0.2), tall, body + 0.01)]


def _rose(rng: np.random.Generator, top: Number) -> Part:
    radius = between(rng, 0.04, 0.08)
    return lathe([(0.6 * radius, top - 0.03), (radius, top - 0.01), (radius, top)], (0, 0, 0), "rose", 16)


def pendant(rng: np.random.Generator) -> list[Part]:
    """Build a shade or ball that hangs on a cable."""
    drop, radius = between(rng, 0.3, 1.1), between(rng, 0.1, 0.32)
    tall = radius * between(rng, 0.6, 1.6)
    head = (
        shade(rng, radius, tall, 0)
        if happens(rng, 0.7)
        else ellipsoid((radius, radius, radius), (0, radius, 0), "shade")
    )
    high = float(head.vertices[:, 1].max())
    return [head, cylinder(0.006, (0, high - 0.02, 0), (0, high + drop, 0), "cable", 6), _rose(rng, high + drop)]


def pendant_row(rng: np.random.Generator) -> list[Part]:
    """Build a bar below the ceiling with several hanging shades."""
    count, gap, drop = whole(rng, 2, 5), between(rng, 0.2, 0.4), between(rng, 0.4, 1.0)
    radius = min(between(rng, 0.07, 0.16), 0.45 * gap)
    single = shade(rng, radius, radius * between(rng, 0.8, 1.8), 0)
    high = float(single.vertices[:, 1].max())
    parts = [box((count * gap, 0.03, 0.06), (0, high + drop, 0), "bar")]
    for k in range(count):
        x = (k - (count - 1) / 2) * gap
        parts += [single.moved((x, 0, 0)), cylinder(0.005, (x, high - 0.01, 0), (x, high + drop, 0), "cable", 6)]
    return parts


def chandelier(rng: np.random.Generator) -> list[Part]:
    """Build arms around a column, each with a candle or a small shade."""
    arms, reach, drop = whole(rng, 3, 8), between(rng, 0.22, 0.45), between(rng, 0.3, 0.7)
    small, up = between(rng, 0.04, 0.08), happens(rng, 0.7)
    parts = [
        lathe(
            [(0.01, -0.12), (0.05, -0.06), (0.02, 0.02), (0.04, 0.1), (0.012, 0.2), (0.012, drop)],
            (0, 0.2, 0),
            "column",
            12,
        )
    ]
    parts.append(_rose(rng, 0.2 + drop))
    single = shade(rng, small, 1.4 * small, 0)
    for angle in np.arange(arms) * 2 * np.pi / arms:
        out = np.array([np.cos(angle), 0, np.sin(angle)])
        tip = out * reach + (0, 0.26, 0)
        path = bezier((0, 0.2, 0), out * 0.6 * reach + (0, between(rng, 0.0, 0.02) + 0.02, 0), tip, 8)
        parts.append(sweep(ellipse(0.016, 0.016, 6), path, "arm"))
        parts.append(cylinder(0.01, tip, tip + (0, 0.07, 0), "candle", 8))
        parts.append(single.moved(tip + (0, 0.03, 0)) if up else single.moved(tip - (0, 1.2 * small, 0)))
    return parts


def ceiling_lamp(rng: np.random.Generator) -> list[Part]:
    """Build a flat bowl, drum or panel that sits on the ceiling."""
    radius, tall = between(rng, 0.14, 0.35), between(rng, 0.06, 0.16)
    style = pick(rng, ("bowl", "drum", "panel"))
    if style == "panel":
        size = (2 * radius * between(rng, 1.0, 2.5), 0.5 * tall, radius * between(rng, 0.6, 1.6))
        return [
            box(size, (0, size[1] / 2, 0), "shade"),
            box((0.8 * size[0], 0.03, 0.8 * size[2]), (0, size[1] + 0.01, 0), "mount"),
        ]
    rows = (
        [(0.05, 0), (0.6 * radius, 0.15 * tall), (0.9 * radius, 0.5 * tall), (radius, tall)]
        if style == "bowl"
        else [(radius, 0), (radius, tall)]
    )
    return [
        lathe(rows, (0, 0, 0), "shade", 24),
        lathe([(0.8 * radius, tall - 0.005), (0.8 * radius, tall + 0.03)], (0, 0, 0), "mount", 20),
    ]


def spots(rng: np.random.Generator) -> list[Part]:
    """Build a rail with tilting spotlights."""
    count, length = whole(rng, 1, 4), between(rng, 0.3, 1.0)
    parts = [box((length, 0.03, 0.05), (0, 0.16, 0), "bar")]
    size, gap = between(rng, 0.03, 0.05), length / count
    for k in range(count):
        x, tilt = (k + 0.5) * gap - length / 2, between(rng, 20, 60)
        head = cylinder(0.7 * size, (0, 0, 0), (0, -0.12, 0), "head", 12, end_radius=size)
        parts.append(head.rotated("x", -tilt).moved((x, 0.09, 0.01)))
        parts.append(cylinder(0.008, (x, 0.08, 0), (x, 0.15, 0), "arm", 6))
    return parts


def wall_lamp(rng: np.random.Generator) -> list[Part]:
    """Build a plate on the wall (at -z), an arm, and a shade in front."""
    tall, out, radius = between(rng, 0.12, 0.3), between(rng, 0.08, 0.2), between(rng, 0.06, 0.12)
    parts = [box((between(rng, 0.06, 0.12), tall, 0.02), (0, 0, -0.01), "mount")]
    arm = rounded_path([(0, -0.2 * tall, 0), (0, -0.2 * tall, out), (0, 0.05, out)], 0.04)
    parts.append(sweep(ellipse(0.014, 0.014, 6), arm, "arm"))
    for x in (0.0,) if happens(rng, 0.7) else (-0.09, 0.09):
        parts.append(
            shade(rng, min(radius, 0.085) if x else radius, between(rng, 0.1, 0.18), 0.0).moved((x, 0.03, out))
        )
    return parts


LAMP_FAMILIES: dict[str, Family] = {
    "standard_lamp": floor_lamp,
    "tripod_lamp": tripod_lamp,
    "arc_lamp": arc_lamp,
    "torchiere": torchiere,
    "table_lamp": table_lamp,
    "jointed_lamp": desk_lamp,
    "pendant": pendant,
    "pendant_row": pendant_row,
    "chandelier": chandelier,
    "ceiling_lamp": ceiling_lamp,
    "spots": spots,
    "wall_lamp": wall_lamp,
}
