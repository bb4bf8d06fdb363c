"""Backs of chairs, built upright over the seat's rear edge and then bent and leaned as one."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from kpred.synthetic.chance import between, happens, pick, whole
from kpred.synthetic.parts import Part, cushion, ellipse, loft, slab, sweep
from kpred.synthetic.paths import rounded_path


@dataclass(frozen=True)
class Bend:
    """How a flat upright back of `width` and `height` (metres, foot at y = 0, facing +z) is shaped.

    `taper`: width at the top over width at the foot; `bow`: depth of the hollow to the back across the width;
    `curve`: how far the top sweeps back beyond the lean; `arch`: rise of the top's middle; `lean`: degrees.
    """

    width: float
    height: float
    taper: float = 1.0
    bow: float = 0.0
    curve: float = 0.0
    arch: float = 0.0
    lean: float = 0.0

    def apply(self, part: Part) -> Part:
        """Bend and lean a part."""
        x, y, z = part.vertices.T
        up = np.clip(y / self.height, 0.0, 1.2)
        across = 1.0 - np.clip(np.abs(2.0 * x / self.width), 0.0, 1.0) ** 2
        bent = np.column_stack(
            [
                x * (1.0 + (self.taper - 1.0) * up),
                y + self.arch * across * up**3,
                z - self.bow * across * np.minimum(1.0, up / 0.3) - self.curve * up**2,
            ]
        )
        return replace(part, vertices=bent).rotated("x", -self.lean)

    def depth_at(self, height: float) -> float:
        """Return z of the back's side edge at `height` over its foot, in the leaned frame."""
        up = height / self.height
        return float(-height * np.tan(np.radians(self.lean)) - self.curve * up**2)

    def half_width_at(self, height: float) -> float:
        """Return half of the back's width at `height` over its foot."""
        return self.width / 2.0 * (1.0 + (self.taper - 1.0) * min(height / self.height, 1.0))


def post(x: float, bottom: float, top: float, width: float, depth: float, label: str, round_bar: bool = False) -> Part:
    """Build an upright bar in several pieces, so that it can be bent."""
    section = ellipse(width, depth, 8) if round_bar else np.array([[1, 1], [-1, 1], [-1, -1], [1, -1]]) / 2.0
    if not round_bar:
        section = section * np.array([width, depth])
    rings = [
        np.column_stack([section[:, 0] + x, np.full(len(section), y), section[:, 1]])
        for y in np.linspace(bottom, top, 5)
    ]
    return loft(np.stack(rings), label)


def rail(half: float, height: float, tall: float, depth: float, label: str, round_bar: bool = False) -> Part:
    """Build a level bar from -half to half in x about `height`, in several pieces, so that it can be bent."""
    section = ellipse(tall, depth, 8) if round_bar else np.array([[1, 1], [-1, 1], [-1, -1], [1, -1]]) / 2.0
    if not round_bar:
        section = section * np.array([tall, depth])
    rings = [
        np.column_stack([np.full(len(section), x), section[:, 0] + height, section[:, 1]])
        for x in np.linspace(-half, half, 9)
    ]
    return loft(np.stack(rings), label)


def sheet(width: float, bottom: float, top: float, depth: float, label: str, x: float = 0.0) -> Part:
    """Build an upright board in a grid of pieces that can be bent both ways."""
    rows = np.linspace(bottom, top, 5)
    ring = np.array([[y, -0.5 * depth] for y in rows] + [[y, 0.5 * depth] for y in rows[::-1]])
    count = len(ring)
    cap = [t for i in range(4) for t in ([i, i + 1, count - 1 - i], [i + 1, count - 2 - i, count - 1 - i])]
    rings = [np.column_stack([np.full(count, u), ring]) for u in np.linspace(x - width / 2, x + width / 2, 7)]
    return replace(loft(np.stack(rings), label, np.array(cap)), ring=0)


def _posts(rng: np.random.Generator, w: float, h: float, t: float, sunk: float) -> tuple[list[Part], float]:
    wide = t * between(rng, 0.9, 1.8)
    round_bar = happens(rng, 0.3)
    bars = [post(s * (w - wide) / 2.0, -sunk, h, wide, t, "back_post", round_bar) for s in (-1.0, 1.0)]
    return bars, w / 2.0 - wide * 0.6


def solid_panel(rng: np.random.Generator, w: float, h: float, t: float, sunk: float) -> list[Part]:
    """Build one board from the seat up."""
    return [sheet(w, -sunk, h, t, "back_panel")]


def raised_panel(rng: np.random.Generator, w: float, h: float, t: float, sunk: float) -> list[Part]:
    """Build a board held over the seat by two posts."""
    bars, half = _posts(rng, w, h, t, sunk)
    low = h * between(rng, 0.2, 0.6)
    if happens(rng, 0.5):
        bars = [post(s * w * 0.32, -sunk, low + 0.05, t * 1.2, t * 0.8, "back_post") for s in (-1.0, 1.0)]
        return [*bars, sheet(w, low, h, t, "back_panel")]
    return [*bars, sheet(2.0 * half + 0.01, low, h * between(rng, 0.92, 1.0), t * 0.6, "back_panel")]


def upholstered(rng: np.random.Generator, w: float, h: float, t: float, sunk: float) -> list[Part]:
    """Build a padded back from the seat up."""
    pad = cushion((w, t * 1.5, h + sunk), (0.0, 0.0, 0.0), "back_cushion", between(rng, 0.02, 0.06), 3)
    return [pad.rotated("x", 90.0).moved((0.0, (h - sunk) / 2.0, 0.0))]


def padded_frame(rng: np.random.Generator, w: float, h: float, t: float, sunk: float) -> list[Part]:
    """Build a pad in a frame of posts and rails."""
    bars, half = _posts(rng, w, h, t, sunk)
    tall = between(rng, 0.03, 0.07)
    low = between(rng, 0.02, 0.25) * h + tall / 2.0
    rails = [rail(half, h - tall / 2.0, tall, t, "back_rail"), rail(half, low, tall, t, "back_rail")]
    return [*bars, *rails, sheet(2.0 * half, low, h - tall, t * between(rng, 0.5, 1.4), "back_cushion")]


def slats(rng: np.random.Generator, w: float, h: float, t: float, sunk: float) -> list[Part]:
    """Build upright slats between two posts."""
    bars, half = _posts(rng, w, h, t, sunk)
    tall = between(rng, 0.04, 0.12)
    rails = [rail(half, h - tall / 2.0, tall, t * 0.9, "back_rail")]
    low = -sunk
    if happens(rng, 0.6):
        low = h * between(rng, 0.08, 0.35)
        rails.append(rail(half, low, between(rng, 0.03, 0.06), t * 0.8, "back_rail"))
    count = whole(rng, 2, 8)
    wide = min(between(rng, 0.3, 0.75) * 2.0 * half / (count + 1), 0.09)
    places = np.linspace(-half, half, count + 2)[1:-1]
    return [*bars, *rails, *(post(x, low, h - tall * 0.8, wide, t * 0.45, "back_slat") for x in places)]


def ladder(rng: np.random.Generator, w: float, h: float, t: float, sunk: float) -> list[Part]:
    """Build level rails between two posts."""
    bars, half = _posts(rng, w, h, t, sunk)
    count = whole(rng, 1, 6)
    low = h * between(rng, 0.15, 0.4)
    tall = min(between(rng, 0.35, 0.8) * (h - low) / count, 0.2)
    places = np.linspace(low + tall / 2.0, h - tall / 2.0 - between(rng, 0.0, 0.06) * h, count)
    if count == 1:
        places = np.array([h - tall / 2.0])
    return [*bars, *(rail(half, y, tall, t * 0.6, "back_rail") for y in places)]


def spindles(rng: np.random.Generator, w: float, h: float, t: float, sunk: float) -> list[Part]:
    """Thin round bars up to a top rail, between posts or not."""
    count = whole(rng, 5, 9)
    tall = between(rng, 0.04, 0.1)
    crest = rail(w / 2.0, h - tall / 2.0, tall, t, "back_rail")
    thin = between(rng, 0.012, 0.02)
    bars = [post(x, -sunk, h - tall / 2.0, thin, thin, "back_spindle", True) for x in np.linspace(-0.4, 0.4, count) * w]
    if happens(rng, 0.6):
        bars += [post(s * w * 0.47, -sunk, h - tall / 2.0, t, t, "back_post", True) for s in (-1.0, 1.0)]
    return [crest, *bars]


def hoop(rng: np.random.Generator, w: float, h: float, t: float, sunk: float) -> list[Part]:
    """Build a bent bow, filled with spindles, a pad, or nothing but a rail."""
    half = w / 2.0 - t / 2.0
    reach = min(half * 0.95, h * 0.6)
    corners = [(-half, -sunk, 0.0), (-half, h - t / 2.0, 0.0), (half, h - t / 2.0, 0.0), (half, -sunk, 0.0)]
    path = rounded_path(corners, reach, 5)
    # Long straight runs are cut so that they can be bent.
    path = np.concatenate([np.linspace(path[0], path[1], 4)[:-1], path[1:-1], np.linspace(path[-2], path[-1], 4)[1:]])
    parts = [sweep(ellipse(t, t, 8), path, "back_frame")]
    kind = pick(rng, ("spindles", "pad", "rails"))
    if kind == "spindles":
        for u in np.linspace(-0.7, 0.7, whole(rng, 3, 8)):
            top = float(np.interp(u * half, path[:, 0], path[:, 1]))
            parts.append(post(u * half, -sunk, top, 0.015, 0.015, "back_spindle", True))
    elif kind == "pad":
        low = h * between(rng, 0.1, 0.4)
        parts.append(sheet(2.0 * half, low, max(h - reach, low + 0.3 * h, 0.7 * h), t * 1.2, "back_panel"))
    else:
        for y in np.linspace(h * 0.3, max(h - reach, h * 0.5), whole(rng, 1, 3)):
            parts.append(rail(half, y, between(rng, 0.03, 0.08), t * 0.7, "back_rail"))
    return parts


def cross_frame(rng: np.random.Generator, w: float, h: float, t: float, sunk: float) -> list[Part]:
    """Build a frame of posts and rails around a cross."""
    bars, half = _posts(rng, w, h, t, sunk)
    tall = between(rng, 0.04, 0.07)
    low = h * between(rng, 0.1, 0.35)
    rails = [rail(half, y, tall, t * 0.9, "back_rail") for y in (low, h - tall / 2.0)]
    thick = between(rng, 0.02, 0.04)
    ends = np.linspace(0.0, 1.0, 5)[:, None]
    section = np.array([[1, 1], [-1, 1], [-1, -1], [1, -1]]) * np.array([t * 0.25, thick / 2.0])
    crosses = []
    for s in (-1.0, 1.0):
        start, end = np.array([-s * half, low, 0.0]), np.array([s * half, h - tall / 2.0, 0.0])
        crosses.append(sweep(section, start + ends * (end - start), "back_cross"))
    return [*bars, *rails, *crosses]


def splat(rng: np.random.Generator, w: float, h: float, t: float, sunk: float) -> list[Part]:
    """Build posts and a top rail around one wide middle board."""
    bars, half = _posts(rng, w, h, t, sunk)
    tall = between(rng, 0.05, 0.12)
    crest = rail(w / 2.0, h - tall / 2.0, tall, t, "back_rail")
    return [*bars, crest, sheet(w * between(rng, 0.2, 0.5), -sunk, h - tall * 0.8, t * 0.5, "back_splat")]


def lattice(rng: np.random.Generator, w: float, h: float, t: float, sunk: float) -> list[Part]:
    """Build a grid of upright and level bars in a frame."""
    bars, half = _posts(rng, w, h, t, sunk)
    tall = between(rng, 0.03, 0.06)
    low = h * between(rng, 0.1, 0.3)
    ys = np.linspace(low, h - tall / 2.0, whole(rng, 3, 5))
    xs = np.linspace(-half, half, whole(rng, 2, 4) + 2)[1:-1]
    rails = [rail(half, y, tall if y in (ys[0], ys[-1]) else tall * 0.5, t * 0.8, "back_rail") for y in ys]
    return [*bars, *rails, *(post(x, low, ys[-1], tall * 0.5, t * 0.6, "back_slat") for x in xs)]


def oval(rng: np.random.Generator, w: float, h: float, t: float, sunk: float) -> list[Part]:
    """Build a round or oval pad on two short posts."""
    tall = min(h * between(rng, 0.6, 0.9), w * 1.4)
    pad = slab(ellipse(w, tall, 20), -t / 2.0, t, "back_panel").rotated("x", 90.0)
    stems = [post(s * w * 0.25, -sunk, h - tall * 0.7, t * 0.9, t * 0.7, "back_post") for s in (-1.0, 1.0)]
    return [pad.moved((0.0, h - tall / 2.0, 0.0)), *stems]


def stem(rng: np.random.Generator, w: float, h: float, t: float, sunk: float) -> list[Part]:
    """Build a pad on a single middle bar, as on task chairs."""
    low = h * between(rng, 0.2, 0.5)
    bar = post(0.0, -sunk, h * 0.75, w * between(rng, 0.08, 0.25), 0.03, "back_post").moved((0.0, 0.0, -t / 2.0 - 0.01))
    if happens(rng, 0.5):
        return [bar, sheet(w, low, h, t, "back_panel")]
    pad = cushion((w, t, h - low), (0.0, 0.0, 0.0), "back_cushion", between(rng, 0.03, 0.12), 3)
    return [bar, pad.rotated("x", 90.0).moved((0.0, (h + low) / 2.0, 0.0))]


BackStyle = Callable[[np.random.Generator, float, float, float, float], list[Part]]

BACK_STYLES: dict[str, BackStyle] = {
    "solid_panel": solid_panel,
    "raised_panel": raised_panel,
    "upholstered": upholstered,
    "padded_frame": padded_frame,
    "slats": slats,
    "ladder": ladder,
    "spindles": spindles,
    "hoop": hoop,
    "cross_frame": cross_frame,
    "splat": splat,
    "lattice": lattice,
    "oval": oval,
    "stem": stem,
}
