"""Table legs and the frames between them: aprons, stretchers, lower shelves."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from kpred.synthetic.chance import between, happens, pick
from kpred.synthetic.parts import Part, beam, box, cylinder, frustum, lathe, sweep

LEG_KINDS = ("square", "tapered", "round", "round_tapered", "turned", "hairpin", "cabriole", "sabre", "angle", "tube")

# A cabriole leg's middle line: fractions of its height, and there its way outwards in units of the splay.
_BENDS = np.array([1.0, 0.85, 0.65, 0.4, 0.15, 0.0])
_CABRIOLE = np.array([0.0, 0.35, 0.2, -0.25, -0.1, 0.45])


@dataclass(frozen=True)
class LegStyle:
    """What one leg of a set looks like; `splay` is how far its foot stands outside its head, metres."""

    kind: str
    thickness: float
    taper: float
    splay: float
    waist: float


def any_leg_style(rng: np.random.Generator, height: float, kinds: Sequence[str] = LEG_KINDS) -> LegStyle:
    """Draw a leg style with proportions for a table of this height (metres)."""
    kind = pick(rng, kinds)
    thick = between(rng, 0.035, 0.09) * (0.65 + 0.5 * height)
    if kind in ("hairpin", "tube"):
        thick = between(rng, 0.018, 0.032)
    elif kind in ("square", "turned") and happens(rng, 0.2):
        thick *= 1.5
    splay = 0.0
    if kind in ("tapered", "round", "round_tapered", "tube") and happens(rng, 0.45):
        splay = height * between(rng, 0.05, 0.22)
    elif kind == "hairpin":
        splay = height * between(rng, 0.0, 0.12)
    elif kind in ("sabre", "cabriole"):
        splay = height * between(rng, 0.06, 0.14)
    return LegStyle(kind, thick, between(rng, 0.4, 0.8), splay, between(rng, 0.45, 0.75))


def _turned(style: LegStyle, x: float, z: float, head: float) -> list[Part]:
    radius = style.thickness / 2
    block = max(min(0.18 * head, 0.14), 0.03)
    neck = radius * style.waist
    stem = head - block
    profile = [
        (neck * 0.8, 0.0),
        (radius * 0.9, 0.05 * stem),
        (neck * 0.7, 0.12 * stem),
        (radius, 0.3 * stem),
        (radius * 0.95, 0.5 * stem),
        (neck, 0.8 * stem),
        (radius * 0.95, 0.87 * stem),
        (neck, 0.93 * stem),
        (radius, stem + 0.002),
    ]
    return [
        lathe(profile, (x, 0.0, z), "leg", 10),
        box((style.thickness, block, style.thickness), (x, head - block / 2, z), "leg"),
    ]


def _bent(style: LegStyle, x: float, z: float, out: np.ndarray, head: float) -> list[Part]:
    heights = _BENDS
    if style.kind == "cabriole":
        swing = _CABRIOLE
        widths = np.array([1.0, 1.15, 0.95, 0.65, 0.5, 0.75])
    else:
        swing = (1 - heights) ** 2
        widths = 1.0 - (1 - style.taper) * (1 - heights)
    path = np.stack([x + out[0] * style.splay * swing, heights * head, z + out[1] * style.splay * swing], axis=1)
    half = style.thickness / 2
    section = np.array([(half, half), (-half, half), (-half, -half), (half, -half)])
    return [sweep(section, path, "leg", scales=widths)]


def leg(style: LegStyle, x: float, z: float, head: float, out: tuple[float, float]) -> list[Part]:
    """Build one leg from its head at (x, head, z) to the floor, splayed towards `out` (x, z)."""
    thick = style.thickness
    away = np.asarray(out, dtype=np.float64)
    foot = (x + away[0] * style.splay, 0.0, z + away[1] * style.splay)
    top = (x, head, z)
    if style.kind == "square":
        return [box((thick, head, thick), (x, head / 2, z), "leg")]
    if style.kind == "tapered":
        slim = thick * style.taper
        return [frustum((slim, slim), (thick, thick), foot, top, "leg")]
    if style.kind in ("round", "tube"):
        return [cylinder(thick / 2, foot, top, "leg", sides=12)]
    if style.kind == "round_tapered":
        return [cylinder(thick / 2 * style.taper, foot, top, "leg", sides=12, end_radius=thick / 2)]
    if style.kind == "turned":
        return _turned(style, x, z, head)
    if style.kind == "hairpin":
        rod, spread = thick / 3.2, 0.055
        across = np.array([-away[1], away[0]])
        parts = [
            cylinder(rod, foot, (x + side * across[0] * spread, head, z + side * across[1] * spread), "leg", sides=8)
            for side in (-1, 1)
        ]
        return parts + [box((0.13, 0.006, 0.13), (x, head - 0.003, z), "leg")]
    if style.kind in ("cabriole", "sabre"):
        return _bent(style, x, z, away, head)
    # An angle: two boards that meet at the outer corner.
    board = thick * 0.3
    sx, sz = np.sign(away[0]) or 1.0, np.sign(away[1]) or 1.0
    return [
        box((board, head, thick), (x + sx * (thick - board) / 2, head / 2, z), "leg"),
        box((thick, head, board), (x, head / 2, z + sz * (thick - board) / 2), "leg"),
    ]


def corners(width: float, depth: float) -> list[tuple[float, float]]:
    """Return the corners (x, z) of a rectangle round the origin."""
    return [(sx * width / 2, sz * depth / 2) for sx in (-1, 1) for sz in (-1, 1)]


def leg_set(style: LegStyle, spots: Sequence[tuple[float, float]], head: float) -> list[Part]:
    """Build legs at the given spots (x, z), each splayed away from the table's middle axis."""
    parts: list[Part] = []
    for x, z in spots:
        out = np.array([x, z]) / (np.hypot(x, z) + 1e-9)
        if style.kind == "angle" or abs(x) > 0.01 and abs(z) > 0.01:
            out = np.array([np.sign(x), np.sign(z)]) * np.sqrt(0.5)
        parts += leg(style, x, z, head, (float(out[0]), float(out[1])))
    return parts


def rails(width: float, depth: float, middle: float, tall: float, thick: float, label: str = "apron") -> list[Part]:
    """Build four boards, `tall` high about `middle`, along a rectangle between the boards' middles."""
    parts = [box((width + thick, tall, thick), (0, middle, side * depth / 2), label) for side in (-1, 1)]
    return parts + [
        box((thick, tall, max(depth - thick, 0.01)), (side * width / 2, middle, 0), label) for side in (-1, 1)
    ]


def stretchers(rng: np.random.Generator, width: float, depth: float, height: float, thick: float) -> list[Part]:
    """Build bars between legs that stand at the corners of a rectangle: box, H, or crossed."""
    form = pick(rng, ("box", "h", "cross", "ends"))
    if form == "box":
        return rails(width, depth, height, thick, thick, "stretcher")
    if form == "cross":
        return [
            beam(
                (-width / 2, height, -side * depth / 2),
                (width / 2, height, side * depth / 2),
                thick,
                thick,
                "stretcher",
            )
            for side in (-1, 1)
        ]
    parts = [box((thick, thick, depth), (side * width / 2, height, 0), "stretcher") for side in (-1, 1)]
    if form == "h":
        parts.append(box((width, thick, thick), (0, height, 0), "stretcher"))
    return parts


def four_legs(
    rng: np.random.Generator,
    width: float,
    depth: float,
    head: float,
    style: LegStyle,
    apron: float = 0.0,
    stretched: bool = False,
    shelf: float | None = None,
) -> list[Part]:
    """Build legs at a rectangle's corners, and the parts that connect them.

    `width` and `depth` are outer measures at the legs' heads, `head` the height at which the top rests, `apron` the
    height of the boards below the top (0: none), `shelf` the height of a lower shelf (None: none).
    """
    w, d = max(width - style.thickness, 0.08), max(depth - style.thickness, 0.08)
    parts = leg_set(style, corners(w, d), head)
    if apron > 0:
        parts += rails(w, d, head - apron / 2, apron, min(0.022, style.thickness * 0.6))
    low = style.kind in ("hairpin",)
    if stretched and not low:
        height = head * between(rng, 0.12, 0.4)
        grow = _drift(style, 1 - height / head)
        parts += stretchers(rng, w + 2 * grow, d + 2 * grow, height, min(style.thickness * 0.6, 0.04))
    if shelf is not None:
        grow = _drift(style, 1 - shelf / head)
        parts.append(box((w + 2 * grow, 0.02, d + 2 * grow), (0, shelf, 0), "shelf"))
    return parts


def _drift(style: LegStyle, fall: float) -> float:
    """Return the offset (x, z) of a leg's body from its head at the fraction `fall` of its height."""
    if style.kind == "angle":
        return 0.3 * style.thickness  # boards at the outer corner: what joins them must reach out to them
    part = fall**2 if style.kind == "sabre" else fall
    if style.kind == "cabriole":
        part = float(np.interp(fall, 1 - _BENDS, _CABRIOLE))
    return style.splay * part * float(np.sqrt(0.5))
