"""Families of doors, windows, radiators, mirrors, fireplaces and curtains: what is fixed to a wall, front at +z."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from kpred.synthetic.chance import between, happens, pick, whole
from kpred.synthetic.others.building import curtain
from kpred.synthetic.others.building import radiator as ribs
from kpred.synthetic.part import Number
from kpred.synthetic.parts import Part, box, cylinder, ellipse, frustum, rounded_rectangle, slab

Family = Callable[[np.random.Generator], list[Part]]


def frame(width: Number, height: Number, bar: Number, depth: Number, sill: bool, label: str = "frame") -> list[Part]:
    """Build a rectangular frame of outer size width x height about x = 0, its lower edge at y = 0; front at +z."""
    parts = [box((bar, height, depth), (s * (width - bar) / 2, height / 2, 0), label) for s in (-1, 1)]
    parts.append(box((width - 2 * bar, bar, depth), (0, height - bar / 2, 0), label))
    if sill:
        parts.append(box((width - 2 * bar, bar, depth), (0, bar / 2, 0), label))
    return parts


def _leaf(rng: np.random.Generator, width: Number, height: Number, style: str) -> list[Part]:
    """Build a door leaf, left edge at x = 0, centred in z."""
    thick = between(rng, 0.03, 0.045)
    stile = between(rng, 0.08, 0.13)
    middle = (width / 2, height / 2, 0)
    if style == "flat":
        parts = [box((width, height, thick), middle, "leaf")]
    else:
        parts = [part.moved((width / 2, 0, 0)) for part in frame(width, height, stile, thick, True, "leaf")]
        rows = whole(rng, 1, 4)
        edges = np.linspace(stile, height - stile, rows + 1)
        for low, high in zip(edges[:-1], edges[1:], strict=True):
            parts.append(box((width - 2 * stile, 0.06, thick), (width / 2, high, 0), "leaf"))
            if style == "louvre":
                parts += [
                    box((width - 2 * stile, 0.03, 0.01), (width / 2, y, 0), "slat").rotated("x", 35, (0, y, 0))
                    for y in np.arange(low + 0.04, high - 0.03, 0.05)
                ]
            else:
                parts.append(
                    box(
                        (width - 2 * stile, high - low, 0.008 if style == "glass" else 0.018),
                        (width / 2, (low + high) / 2, 0),
                        "panel",
                    )
                )
    y, x = between(rng, 0.95, 1.08), width - 0.06
    for s in (-1, 1):
        parts.append(cylinder(0.012, (x, y, s * thick / 2), (x, y, s * (thick / 2 + 0.05)), "handle", 8))
        if happens(rng, 0.7):
            parts.append(box((0.12, 0.018, 0.014), (x - 0.05, y, s * (thick / 2 + 0.05)), "handle"))
    return parts


def door(rng: np.random.Generator) -> list[Part]:
    """Build a door leaf in its frame, closed or ajar, or the leaf alone."""
    width, height = between(rng, 0.7, 1.0), between(rng, 1.95, 2.2)
    leaf = _leaf(rng, width, height, pick(rng, ("flat", "panels", "panels", "glass", "louvre")))
    if happens(rng, 0.3):
        return leaf
    bar, deep = between(rng, 0.06, 0.12), between(rng, 0.06, 0.2)
    swing = between(rng, 15, 95) if happens(rng, 0.25) else 0.0
    turned = [part.rotated("y", -swing).moved((-width / 2, 0, 0)) for part in leaf]
    parts = frame(width + 2 * bar, height + bar, bar, deep, False) + turned
    return [part.mirrored_x() for part in parts] if happens(rng, 0.5) else parts


def double_door(rng: np.random.Generator) -> list[Part]:
    """Build two leaves that meet in the middle of a frame."""
    width, height, style = between(rng, 0.6, 0.9), between(rng, 2.0, 2.3), pick(rng, ("flat", "panels", "glass"))
    leaf = [part.moved((-width, 0, 0)) for part in _leaf(rng, width, height, style)]
    bar = between(rng, 0.06, 0.12)
    return (
        frame(2 * width + 2 * bar, height + bar, bar, between(rng, 0.06, 0.16), False)
        + leaf
        + [part.mirrored_x() for part in leaf]
    )


def window(rng: np.random.Generator) -> list[Part]:
    """Build a frame with one to three casements, glazing bars, a sill and perhaps shutters."""
    width, height, bar = between(rng, 0.5, 1.8), between(rng, 0.6, 1.7), between(rng, 0.04, 0.08)
    deep, count = between(rng, 0.05, 0.14), 1 if width < 0.8 else whole(rng, 2, 3)
    parts = frame(width, height, bar, deep, True)
    each = (width - 2 * bar) / count
    rows = pick(rng, (0, 0, 1, 2))
    for k in range(count):
        x = ((k + 0.5) / count - 0.5) * (width - 2 * bar)
        inner = frame(each, height - 2 * bar, 0.7 * bar, 0.6 * deep, True, "casement")
        inner.append(box((each - bar, height - 3 * bar, 0.008), (0, (height - 2 * bar) / 2, 0), "pane"))
        inner += [
            box((each - bar, 0.025, 0.02), (0, (height - 2 * bar) * (j + 1) / (rows + 1), 0), "bar")
            for j in range(rows)
        ]
        parts += [part.moved((x, bar, 0)) for part in inner]
    if happens(rng, 0.5):
        parts.append(box((width + 0.08, 0.03, deep + 0.14), (0, -0.015, 0.06), "sill"))
    if happens(rng, 0.2):
        parts += [box((width / 2, height, 0.03), (s * 0.75 * width, height / 2, deep / 2), "shutter") for s in (-1, 1)]
    return parts


def round_window(rng: np.random.Generator) -> list[Part]:
    """Build a window with an arch on top."""
    width, height = between(rng, 0.6, 1.2), between(rng, 0.7, 1.4)
    bar, deep = between(rng, 0.04, 0.08), between(rng, 0.06, 0.14)
    parts = [box((bar, height, deep), (x * (width - bar) / 2, height / 2, 0), "frame") for x in (-1, 0, 1)]
    parts += [box((width, bar, deep), (0, y, 0), "frame") for y in (bar / 2, height)]
    angles = np.radians(np.linspace(0, 180, 11))
    rim = np.column_stack([np.cos(angles), np.sin(angles)]) * (width - bar) / 2
    for a, b in zip(rim[:-1], rim[1:], strict=True):
        parts.append(cylinder(bar / 2, (a[0], height + a[1], 0), (b[0], height + b[1], 0), "frame", 6))
    return [*parts, box((width - bar, height, 0.008), (0, height / 2, 0), "pane")]


def panel_radiator(rng: np.random.Generator) -> list[Part]:
    """Build a flat panel, once or twice, with a grille on top and pipes."""
    width, height, lift = between(rng, 0.4, 2.0), between(rng, 0.3, 0.9), between(rng, 0.08, 0.16)
    gap, count = between(rng, 0.04, 0.09), whole(rng, 1, 2)
    parts = [box((width, height, 0.02), (0, lift + height / 2, k * gap), "panel") for k in range(count)]
    parts.append(box((width, 0.02, gap * count), (0, lift + height, gap * (count - 1) / 2), "grille"))
    ridges = whole(rng, 0, 14)
    parts += [
        box(
            (0.02, 0.88 * height, 0.012),
            (((k + 0.5) / ridges - 0.5) * width * 0.95, lift + height / 2, (count - 1) * gap + 0.012),
            "ridge",
        )
        for k in range(ridges)
    ]
    parts += [cylinder(0.01, (s * 0.42 * width, 0, 0), (s * 0.42 * width, lift + 0.03, 0), "pipe", 8) for s in (-1, 1)]
    return parts


def towel_rail(rng: np.random.Generator) -> list[Part]:
    """Build a tall radiator of bars between two upright tubes."""
    width, height, groups = between(rng, 0.4, 0.6), between(rng, 0.7, 1.8), whole(rng, 2, 4)
    parts = [cylinder(0.016, (s * width / 2, 0, 0), (s * width / 2, height, 0), "tube", 8) for s in (-1, 1)]
    for g in range(groups):
        low, high = height * (g + 0.08) / groups, height * (g + 0.8) / groups
        parts += [
            cylinder(0.011, (-width / 2, y, 0.01), (width / 2, y, 0.01), "bar", 6)
            for y in np.linspace(low, high, whole(rng, 3, 7))
        ]
    return parts


def mirror(rng: np.random.Generator) -> list[Part]:
    """Build a framed mirror or picture, rectangular, round or standing on a foot."""
    width, height, thick = between(rng, 0.4, 1.0), between(rng, 0.4, 1.8), between(rng, 0.015, 0.05)
    if happens(rng, 0.4):
        disc = slab(ellipse(width, pick(rng, (width, height)), 28), 0, thick, "frame").rotated("x", 90)
        glass = slab(ellipse(0.9 * width, 0.9 * float(np.ptp(disc.vertices[:, 1])), 28), 0, 0.006, "glass").rotated(
            "x", 90
        )
        return [disc, glass.moved((0, 0, 0.008))]
    bar = between(rng, 0.02, 0.09)
    parts = [
        *frame(width, height, bar, thick, True),
        box((width - bar, height - bar, 0.008), (0, height / 2, 0), "glass"),
    ]
    if height > 1.2 and happens(rng, 0.6):
        parts = [part.rotated("x", -8) for part in parts]
        parts.append(
            box((0.04, 0.9 * height, 0.03), (0, 0.45 * height, 0), "foot")
            .rotated("x", 12)
            .moved((0, 0.02, -0.3 * height))
        )
    return parts


def fireplace(rng: np.random.Generator) -> list[Part]:
    """Build a mantel around an opening, with a hearth and perhaps a breast above."""
    width, height, deep = between(rng, 1.0, 1.7), between(rng, 0.9, 1.3), between(rng, 0.15, 0.4)
    side, top = between(rng, 0.15, 0.3), between(rng, 0.15, 0.35)
    parts = [box((side, height - top, deep), (s * (width - side) / 2, (height - top) / 2, 0), "jamb") for s in (-1, 1)]
    parts.append(box((width, top, deep), (0, height - top / 2, 0), "lintel"))
    parts.append(box((width - 2 * side, height - top, 0.03), (0, (height - top) / 2, -deep / 2 + 0.015), "back"))
    parts.append(box((width + 0.15, 0.05, deep + 0.12), (0, height + 0.025, 0.03), "shelf"))
    if happens(rng, 0.6):
        parts.append(box((width + 0.1, 0.05, deep + 0.5), (0, -0.025, 0.25), "hearth"))
    return parts


def stove(rng: np.random.Generator) -> list[Part]:
    """Build an iron stove with a door, legs and a pipe."""
    width, height, deep, legs = (
        between(rng, 0.4, 0.65),
        between(rng, 0.6, 1.1),
        between(rng, 0.35, 0.5),
        between(rng, 0.0, 0.2),
    )
    parts = [
        box((width, height - legs, deep), (0, (height + legs) / 2, 0), "body"),
        box((width + 0.06, 0.03, deep + 0.06), (0, height, 0), "top"),
    ]
    parts.append(
        box((0.7 * width, 0.5 * (height - legs), 0.03), (0, legs + 0.5 * (height - legs), deep / 2 + 0.012), "door")
    )
    parts += [
        frustum(
            (0.04, 0.04),
            (0.07, 0.07),
            (a * 0.42 * width, 0, b * 0.4 * deep),
            (a * 0.42 * width, legs + 0.01, b * 0.4 * deep),
            "leg",
        )
        for a in (-1, 1)
        for b in (-1, 1)
        if legs > 0.02
    ]
    return [*parts, cylinder(0.07, (0, height, -0.05), (0, height + between(rng, 0.2, 0.8), -0.05), "pipe", 12)]


def panel(rng: np.random.Generator) -> list[Part]:
    """Build a folding screen of three or four leaves."""
    count, width, height, fold = whole(rng, 3, 4), between(rng, 0.35, 0.5), between(rng, 1.4, 1.8), between(rng, 15, 40)
    parts, x, z = [], 0.0, 0.0
    for k in range(count):
        angle = fold if k % 2 else -fold
        board = frame(width, height, 0.04, 0.025, True) + [
            slab(rounded_rectangle(width - 0.06, height - 0.06, 0), 0, 0.008, "panel")
            .rotated("x", 90)
            .moved((0, height / 2, 0))
        ]
        step = width * np.array([np.cos(np.radians(angle)), -np.sin(np.radians(angle))])
        parts += [part.rotated("y", angle).moved((x + step[0] / 2, 0, z + step[1] / 2)) for part in board]
        x, z = x + step[0], z + step[1]
    return parts


DOOR_FAMILIES: dict[str, Family] = {"door": door, "double_door": double_door}
WINDOW_FAMILIES: dict[str, Family] = {"window": window, "arched_window": round_window}
RADIATOR_FAMILIES: dict[str, Family] = {
    "ribbed_radiator": ribs,
    "panel_radiator": panel_radiator,
    "towel_rail": towel_rail,
}
MIRROR_FAMILIES: dict[str, Family] = {"mirror": mirror}
FIREPLACE_FAMILIES: dict[str, Family] = {"fireplace": fireplace, "iron_stove": stove}
CURTAIN_FAMILIES: dict[str, Family] = {"curtain": curtain, "folding_screen": panel}
