"""Parts of coarse chairs: legs, stretchers, apron, back and arms."""

from __future__ import annotations

import numpy as np

from kpred.synthetic.chance import between, happens, pick, whole
from kpred.synthetic.parts import Part, box, splayed_legs


def corner_posts(
    rng: np.random.Generator, width: float, depth: float, head: float, size: float, straight: bool = False
) -> list[Part]:
    """Build four legs at the corners, splayed or tapered at times unless `straight`."""
    x, z = (width - size) / 2, (depth - size) / 2
    out = 0.0 if straight else pick(rng, (0.0, 0.0, between(rng, -0.03, 0.12))) * head
    foot = size if straight else size * pick(rng, (1.0, 1.0, between(rng, 0.4, 1.1)))
    return splayed_legs((x, z), out, (foot, foot), (size, size), head + 0.002)


def stretchers(rng: np.random.Generator, width: float, depth: float, head: float, size: float) -> list[Part]:
    """Build bars between straight legs."""
    x, z, bar = (width - size) / 2, (depth - size) / 2, size * between(rng, 0.4, 0.9)
    y = head * between(rng, 0.15, 0.6)
    parts = [box((bar, bar, 2 * z), (s * x, y, 0), "stretcher") for s in (-1, 1)]
    across = pick(rng, ("front", "both", "middle", "none"))
    if across == "middle":
        parts.append(box((2 * x, bar, bar), (0, y, 0), "stretcher"))
    elif across != "none":
        parts += [box((2 * x, bar, bar), (0, y, s * z), "stretcher") for s in ((1,) if across == "front" else (-1, 1))]
    return parts


def apron(rng: np.random.Generator, width: float, depth: float, head: float) -> list[Part]:
    """Build boards under the edges of the seat, in some chairs."""
    if not happens(rng, 0.3):
        return []
    tall = head * between(rng, 0.08, 0.3)
    return [box((width * 0.96, tall, depth * 0.96), (0, head - tall / 2 + 0.002, 0), "seat_frame")]


def plain_back(rng: np.random.Generator, width: float, depth: float, seat: float, rise: float) -> list[Part]:
    """Build a back on the seat's rear edge: a panel, bars between rails, or a panel on posts."""
    kind = pick(rng, ("panel", "panel", "panel", "slats", "ladder", "framed", "rail", "two"))
    thick = depth * pick(rng, (between(rng, 0.03, 0.1), between(rng, 0.08, 0.3)))
    wide = width * pick(rng, (1.0, 1.0, between(rng, 0.7, 1.1)))
    z, low, top = -(depth - thick) / 2, seat - 0.01, seat + rise
    parts: list[Part] = []
    if kind == "panel":
        parts.append(box((wide, top - low, thick), (0, (low + top) / 2, z), "back_panel"))
        if happens(rng, 0.2):
            tall, more = rise * between(rng, 0.1, 0.3), pick(rng, (between(rng, 0.01, 0.06), -0.1))
            size = (wide + 2 * more, tall, thick * between(rng, 0.8, 1.6))
            parts.append(box(size, (0, top + tall / 2 - 0.004, z), "back_rail"))
    elif kind == "two":
        half = (low + top) / 2 + rise * between(rng, -0.2, 0.2)
        parts.append(box((wide, half - low + 0.004, thick), (0, (low + half) / 2, z), "back_panel"))
        parts.append(
            box((wide * between(rng, 0.5, 1.2), top - half, thick * 0.8), (0, (half + top) / 2, z), "back_panel")
        )
    else:
        post = wide * between(rng, 0.06, 0.16)
        thick = max(min(thick, 0.14 * depth), 0.015)
        z = -(depth - thick) / 2
        rail = rise * between(rng, 0.08, 0.35)
        parts.append(box((wide * pick(rng, (1.0, 1.05)), rail, thick), (0, top - rail / 2, z), "back_rail"))
        outer = kind != "slats" or happens(rng, 0.6)
        if outer:
            x = (wide - post) / 2
            parts += [
                box((post, top - low - rail * 0.5, thick), (s * x, (low + top - rail * 0.5) / 2, z), "back_post")
                for s in (-1, 1)
            ]
        if kind == "slats":
            count = whole(rng, 3, 7)
            bar = wide / count * between(rng, 0.2, 0.6)
            for x in np.linspace(-0.38, 0.38, count) * wide:
                parts.append(
                    box(
                        (bar, top - low - rail * 0.5, thick * 0.7),
                        (float(x), (low + top - rail * 0.5) / 2, z),
                        "back_slat",
                    )
                )
        elif kind == "ladder":
            count = whole(rng, 1, 4)
            for k in range(count):
                y = seat + (rise - rail) * (k + 0.7) / (count + 0.4)
                parts.append(box((wide - post, rise * between(rng, 0.06, 0.16), thick * 0.7), (0, y, z), "back_slat"))
        elif kind == "framed":
            tall = rise - rail
            parts.append(
                box(
                    (wide - 1.4 * post, tall * between(rng, 0.5, 1.0), thick * 0.5),
                    (0, top - rail * 0.5 - tall * 0.45, z),
                    "back_panel",
                )
            )
    lean = pick(rng, (0.0, between(rng, 0, 8), between(rng, 5, 25)))
    # Leaned about the seat's rear edge, backwards.
    return [part.rotated("x", -lean, (0.0, seat - 0.005, -depth / 2 + thick)) for part in parts]


def plain_arms(rng: np.random.Generator, width: float, depth: float, seat: float, chance: float = 0.4) -> list[Part]:
    """Build arms at both sides: rests on posts, panels down to the seat, or blocks; sometimes none."""
    if not happens(rng, chance):
        return []
    rise = between(rng, 0.12, 0.32)
    wide = pick(rng, (between(rng, 0.025, 0.06), between(rng, 0.05, 0.18)))
    long = depth * between(rng, 0.6, 1.0)
    z = -(depth - long) / 2
    kind = pick(rng, ("rest", "panel", "block"))
    right: list[Part] = []
    x = width / 2 + wide / 2 - 0.006 - pick(rng, (0.0, wide))
    if kind == "block":
        low = seat * between(rng, 0.0, 0.8)
        right.append(box((wide, seat + rise - low, long), (x, (low + seat + rise) / 2, z), "arm"))
    elif kind == "panel":
        right.append(box((wide, rise + 0.02, long), (x, seat + rise / 2 - 0.01, z), "arm"))
    else:
        bar = between(rng, 0.02, 0.05)
        right.append(box((max(wide, bar), bar, long), (x, seat + rise - bar / 2, z), "arm"))
        for at in (0.42, -0.42) if happens(rng, 0.5) else (0.42,):
            foot = seat - (0.01 if abs(x) < width / 2 else 0.03)
            right.append(
                box(
                    (bar, seat + rise - foot - 0.004, bar),
                    (min(x, width / 2 - bar * 0.2), (foot + seat + rise) / 2, z + at * long),
                    "arm_post",
                )
            )
    return [*right, *(part.mirrored_x() for part in right)]
