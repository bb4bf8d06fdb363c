"""Families of beds: platform, panelled, upholstered, four posts, bunk, cot, metal, with drawers."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from kpred.synthetic.chair.upholstered import standing_cushion
from kpred.synthetic.chance import between, happens, pick, whole
from kpred.synthetic.part import Number
from kpred.synthetic.parts import Part, beam, box, curved_panel, cushion, cylinder, ellipse, sweep
from kpred.synthetic.paths import rounded_path

Family = Callable[[np.random.Generator], list[Part]]


@dataclass(frozen=True)
class Bed:
    """Measures (metres) that all parts of a bed share; the head is at -z."""

    width: float
    length: float
    frame: float
    top: float


def _bed(rng: np.random.Generator, widths: tuple[float, ...] = (0.9, 1.2, 1.4, 1.6, 1.8, 2.0)) -> Bed:
    frame = between(rng, 0.22, 0.4)
    return Bed(
        pick(rng, widths) + between(rng, 0.0, 0.1), between(rng, 1.9, 2.2), frame, frame + between(rng, 0.12, 0.28)
    )


def _bedding(rng: np.random.Generator, bed: Bed, low: Number | None = None) -> list[Part]:
    """Build mattress, pillows and perhaps a blanket; the mattress begins at `low`."""
    start = bed.frame if low is None else low
    thick, top = bed.top - bed.frame, start + bed.top - bed.frame
    parts = [cushion((0.96 * bed.width, thick, 0.97 * bed.length), (0, start + thick / 2, 0), "mattress", 0.04, 2)]
    places = (0.0,) if bed.width < 1.2 else (-0.24, 0.24)
    if happens(rng, 0.85):
        wide = min(0.7, 0.42 * bed.width if len(places) > 1 else 0.75 * bed.width)
        for x in places:
            parts.append(
                cushion((wide, 0.13, 0.38), (x * bed.width, top + 0.05, -bed.length / 2 + 0.27), "pillow", 0.05, 2)
            )
    if happens(rng, 0.5):
        reach = between(rng, 0.5, 0.75) * bed.length
        size = (bed.width * 1.02, thick * 0.8 + 0.04, reach)
        parts.append(cushion(size, (0, top + 0.03 - size[1] / 2, bed.length / 2 - reach / 2), "blanket", 0.03, 2))
    return parts


def _side_rails(bed: Bed, low: Number, thick: Number = 0.03) -> list[Part]:
    size = (thick, bed.frame - low + 0.05, bed.length)
    rails = [box(size, (s * bed.width / 2, (bed.frame + low + 0.05) / 2, 0), "rail") for s in (-1, 1)]
    base = box((bed.width - thick, 0.04, bed.length - 0.04), (0, bed.frame - 0.02, 0), "slats")
    return [*rails, base]


def _legs(bed: Bed, height: Number, thick: Number, length: Number | None = None) -> list[Part]:
    reach = (bed.length if length is None else length) / 2 - thick
    return [
        beam(
            (x * (bed.width / 2 - thick), 0, z * reach),
            (x * (bed.width / 2 - thick), height, z * reach),
            thick,
            thick,
            "leg",
        )
        for x in (-1, 1)
        for z in (-1, 1)
    ]


def platform(rng: np.random.Generator) -> list[Part]:
    """Build a mattress on a low wide board, without a headboard or with a plain one."""
    bed, over, thick = _bed(rng), between(rng, 0.0, 0.2), between(rng, 0.05, 0.16)
    size = (bed.width + 2 * over, thick, bed.length + over)
    parts = [box(size, (0, bed.frame - thick / 2, 0), "frame"), *_bedding(rng, bed)]
    if happens(rng, 0.5):
        parts.append(
            box(
                (0.8 * bed.width, bed.frame - thick + 0.01, 0.8 * bed.length), (0, (bed.frame - thick) / 2, 0), "plinth"
            )
        )
    else:
        parts += _legs(bed, bed.frame - thick + 0.01, between(rng, 0.05, 0.1))
    if happens(rng, 0.6):
        tall = bed.top + between(rng, 0.1, 0.5)
        parts.append(box((size[0] * between(rng, 1.0, 1.5), tall, 0.05), (0, tall / 2, -size[2] / 2), "headboard"))
    return parts


def panelled(rng: np.random.Generator) -> list[Part]:
    """Build a head- and a footboard with posts, filled by panels, and side rails."""
    bed, post = _bed(rng), between(rng, 0.05, 0.1)
    parts = [*_side_rails(bed, bed.frame - between(rng, 0.05, 0.15)), *_bedding(rng, bed)]
    boards = [(-1, bed.top + between(rng, 0.25, 0.7), "headboard")]
    if happens(rng, 0.75):
        boards.append((1, bed.top + between(rng, -0.1, 0.3), "footboard"))
    style = pick(rng, ("panel", "slats", "rails"))
    for end, tall, label in boards:
        z = end * bed.length / 2
        for side in (-1, 1):
            knob = tall + (between(rng, 0.0, 0.08) if happens(rng, 0.5) else 0.0)
            parts.append(beam((side * bed.width / 2, 0, z), (side * bed.width / 2, knob, z), post, post, "post"))
        low = bed.frame * 0.6
        if style == "panel":
            parts.append(box((bed.width, tall - low - 0.03, 0.03), (0, (tall + low) / 2, z), label))
            continue
        bars = [box((bed.width, 0.07, 0.035), (0, y, z), label) for y in (low, tall - 0.05)]
        if style == "slats":
            count = whole(rng, 5, 12)
            bars += [
                box(
                    (0.05, tall - low - 0.06, 0.02), (((k + 0.5) / count - 0.5) * bed.width, (tall + low) / 2, z), label
                )
                for k in range(count)
            ]
        else:
            bars += [box((bed.width, 0.09, 0.025), (0, low + (tall - low) * f, z), label) for f in (0.35, 0.65)]
        parts += bars
    if len(boards) == 1:
        parts += [
            beam(
                (s * (bed.width / 2 - 0.05), 0, bed.length / 2 - 0.08),
                (s * (bed.width / 2 - 0.05), bed.frame, bed.length / 2 - 0.08),
                post,
                post,
                "leg",
            )
            for s in (-1, 1)
        ]
    return parts


def upholstered_bed(rng: np.random.Generator) -> list[Part]:
    """Build a box bed with a padded headboard, straight, winged or in squares."""
    bed, feet = _bed(rng), between(rng, 0.0, 0.12)
    parts = [
        cushion((bed.width, bed.frame - feet, bed.length), (0, (bed.frame + feet) / 2, 0), "frame", 0.03, 2),
        *_bedding(rng, bed),
    ]
    tall, thick, wide = bed.top + between(rng, 0.3, 0.75), between(rng, 0.06, 0.14), bed.width + between(rng, 0.0, 0.2)
    z = -bed.length / 2 - thick / 2
    count = pick(rng, (1, 1, 2, 4))
    for k in range(count):
        size = (wide / count, tall - feet, thick)
        parts.append(standing_cushion(size, (((k + 0.5) / count - 0.5) * wide, feet, z), 0, "headboard", 0.03))
    if happens(rng, 0.3):
        for s in (-1, 1):
            parts.append(box((0.07, tall - feet, 0.25), (s * (wide / 2 + 0.035), (tall + feet) / 2, z + 0.1), "wing"))
    return parts + _legs(bed, feet + 0.01, 0.06)


def four_posts(rng: np.random.Generator) -> list[Part]:
    """Build a bed with a post at each corner, joined by a frame overhead, perhaps under a canopy."""
    bed, post, high = _bed(rng, (1.4, 1.6, 1.8)), between(rng, 0.05, 0.09), between(rng, 1.7, 2.2)
    parts = [*_side_rails(bed, bed.frame - 0.12), *_bedding(rng, bed)]
    for x in (-1, 1):
        for z in (-1, 1):
            foot = (x * bed.width / 2, 0, z * bed.length / 2)
            parts.append(beam(foot, (foot[0], high, foot[2]), post, post, "post"))
        parts.append(box((post, post, bed.length), (x * bed.width / 2, high - post / 2, 0), "canopy_rail"))
        parts.append(box((bed.width, post, post), (0, high - post / 2, x * bed.length / 2), "canopy_rail"))
    tall = bed.top + between(rng, 0.3, 0.6)
    parts.append(box((bed.width, tall - 0.2, 0.04), (0, (tall + 0.2) / 2, -bed.length / 2), "headboard"))
    canopy = box((bed.width, 0.02, bed.length), (0, high, 0), "canopy")
    return [*parts, canopy] if happens(rng, 0.3) else parts


def bunk(rng: np.random.Generator) -> list[Part]:
    """Build two beds above each other, or one over free floor, with a guard and a ladder."""
    bed, post, high = _bed(rng, (0.8, 0.9, 1.0)), between(rng, 0.05, 0.08), between(rng, 1.2, 1.5)
    full = high + between(rng, 0.4, 0.6)
    parts = []
    for level in (bed.frame, high) if happens(rng, 0.7) else (high,):
        parts += [box((0.03, 0.14, bed.length), (s * bed.width / 2, level - 0.03, 0), "rail") for s in (-1, 1)]
        parts += [box((bed.width, 0.14, 0.03), (0, level - 0.03, s * bed.length / 2), "rail") for s in (-1, 1)]
        parts.append(box((bed.width, 0.03, bed.length), (0, level - 0.02, 0), "slats"))
        parts += _bedding(rng, bed, level)
    for x in (-1, 1):
        for z in (-1, 1):
            foot = (x * bed.width / 2, 0, z * bed.length / 2)
            parts.append(beam(foot, (foot[0], full, foot[2]), post, post, "post"))
        # The ladder's side has a gap at its end.
        long, middle = (0.7 * bed.length, -0.15 * bed.length) if x > 0 else (bed.length, 0)
        for y in (high + 0.22, full - 0.05):
            parts.append(box((0.025, 0.08, long), (x * bed.width / 2, y, middle), "guard"))
        parts.append(box((bed.width, 0.08, 0.025), (0, full - 0.05, x * bed.length / 2), "guard"))
    beside = bed.width / 2 + 0.05
    for along in (0.25, 0.25 + 0.35 / bed.length):
        parts.append(
            beam((beside, 0, along * bed.length), (beside, high + 0.25, along * bed.length), 0.03, 0.05, "ladder")
        )
    for k in range(4):
        y = high * (k + 0.8) / 4.3
        parts.append(box((0.03, 0.03, 0.35), (beside, y, 0.25 * bed.length + 0.175), "rung"))
    return parts


def cot(rng: np.random.Generator) -> list[Part]:
    """Build a child's bed with bars on its sides."""
    width, length, high, low = (
        between(rng, 0.6, 0.75),
        between(rng, 1.15, 1.45),
        between(rng, 0.85, 1.05),
        between(rng, 0.25, 0.5),
    )
    bars = whole(rng, 7, 13)
    parts = [
        box((width, 0.03, length), (0, low, 0), "slats"),
        cushion((width - 0.03, 0.1, length - 0.03), (0, low + 0.06, 0), "mattress", 0.03),
    ]
    for x in (-1, 1):
        for z in (-1, 1):
            parts.append(
                beam((x * width / 2, 0, z * length / 2), (x * width / 2, high, z * length / 2), 0.045, 0.045, "post")
            )
        for y in (low - 0.05, high - 0.03):
            parts.append(box((0.03, 0.05, length), (x * width / 2, y, 0), "rail"))
            parts.append(box((width, 0.05, 0.03), (0, y, x * length / 2), "rail"))
        for k in range(bars):
            along = ((k + 0.5) / bars - 0.5) * length
            parts.append(
                cylinder(0.01, (x * width / 2, low - 0.05, along), (x * width / 2, high - 0.03, along), "bar", 6)
            )
    if happens(rng, 0.5):
        parts += [box((width, high - low, 0.02), (0, (high + low) / 2, z * length / 2), "end_board") for z in (-1, 1)]
    return parts


def metal(rng: np.random.Generator) -> list[Part]:
    """Build a bed whose ends are bent tubes with bars between."""
    bed, tube = _bed(rng), between(rng, 0.025, 0.045)
    parts = [*_side_rails(bed, bed.frame - 0.06), *_bedding(rng, bed)]
    section, bend = ellipse(tube, tube, 8), between(rng, 0.02, 0.3)
    for end, tall in ((-1, bed.top + between(rng, 0.3, 0.7)), (1, bed.top + between(rng, -0.05, 0.4))):
        z, x = end * bed.length / 2, bed.width / 2
        hoop = rounded_path([(-x, 0, z), (-x, tall, z), (x, tall, z), (x, 0, z)], bend, 5)
        parts.append(sweep(section, hoop, "end_tube"))
        parts.append(cylinder(tube / 2, (-x, bed.frame, z), (x, bed.frame, z), "end_tube", 8))
        count = whole(rng, 3, 9)
        for k in range(count):
            across = ((k + 1) / (count + 1) - 0.5) * bed.width
            parts.append(cylinder(0.007, (across, bed.frame, z), (across, tall - 0.02, z), "bar", 6))
    return parts


def with_drawers(rng: np.random.Generator) -> list[Part]:
    """Build a chest-like bed with drawers in its sides and a shelf or board at its head."""
    bed = _bed(rng)
    parts = [box((bed.width, bed.frame, bed.length), (0, bed.frame / 2, 0), "frame"), *_bedding(rng, bed)]
    count = whole(rng, 2, 3)
    for s in (-1, 1):
        for k in range(count):
            z = ((k + 0.5) / count - 0.5) * bed.length
            parts.append(
                box(
                    (0.02, 0.7 * bed.frame, bed.length / count - 0.04),
                    (s * (bed.width / 2 + 0.01), bed.frame / 2, z),
                    "drawer",
                )
            )
    tall, deep = bed.top + between(rng, 0.3, 0.6), between(rng, 0.04, 0.25)
    parts.append(box((bed.width, tall, deep), (0, tall / 2, -bed.length / 2 - deep / 2), "headboard"))
    return parts


def sleigh(rng: np.random.Generator) -> list[Part]:
    """Build a bed between two curled boards."""
    bed, thick = _bed(rng, (1.4, 1.6, 1.8)), between(rng, 0.04, 0.07)
    parts = [*_side_rails(bed, 0.08), *_bedding(rng, bed)]
    for end, tall in ((-1, bed.top + between(rng, 0.35, 0.6)), (1, bed.top + between(rng, 0.05, 0.25))):
        board = curved_panel(
            tall,
            bed.width,
            thick,
            between(rng, 0.06, 0.16) * end,
            0,
            (0, 0, 0),
            "headboard" if end < 0 else "footboard",
        )
        parts.append(board.rotated("z", 90).moved((0, tall / 2, end * (bed.length / 2 + 0.04))))
    return parts


BED_FAMILIES: dict[str, Family] = {
    "platform_bed": platform,
    "panelled_bed": panelled,
    "upholstered_bed": upholstered_bed,
    "four_poster": four_posts,
    "bunk_bed": bunk,
    "cot": cot,
    "metal_bed": metal,
    "bed_with_drawers": with_drawers,
    "sleigh_bed": sleigh,
}
