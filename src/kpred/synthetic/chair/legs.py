"""Legs and stretchers that carry a seat from its four corners."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from kpred.synthetic.chance import between, happens, pick, whole
from kpred.synthetic.parts import Part, beam, box, cylinder, ellipse, frustum, lathe, sweep
from kpred.synthetic.paths import rounded_path

LEG_STYLES = ("square", "tapered", "round", "cone", "turned", "sabre", "cabriole", "hairpin")
STRETCHERS = ("none", "h", "ring", "sides", "front", "x")


@dataclass(frozen=True)
class Legs:
    """Center lines of four legs: `feet` and `heads` (4, 3), order front left, front right, back left, back right."""

    feet: np.ndarray
    heads: np.ndarray
    thickness: float

    def at(self, index: int, height: float) -> np.ndarray:
        """Point (3,) of a leg's center line at `height`."""
        foot, head = self.feet[index], self.heads[index]
        return foot + (head - foot) * (height - foot[1]) / (head[1] - foot[1])


def corner_legs(
    rng: np.random.Generator,
    width: float,
    depth: float,
    height: float,
    thickness: float,
    splay: float = 0.0,
    back_rake: float = 0.0,
    inset: float = 0.0,
    back_narrowing: float = 1.0,
) -> Legs:
    """Draw center lines of legs under a seat of `width` x `depth` with underside at `height`.

    `splay`, `back_rake`: metres by which the feet stand outside the heads, all around and at the back only.
    """
    x, z = width / 2.0 - inset - thickness / 2.0, depth / 2.0 - inset - thickness / 2.0
    heads = np.array(
        [[-x, height, z], [x, height, z], [-x * back_narrowing, height, -z], [x * back_narrowing, height, -z]]
    )
    feet = heads.copy()
    feet[:, 1] = 0.0
    feet[:, 0] += np.sign(heads[:, 0]) * splay
    feet[:, 2] += np.sign(heads[:, 2]) * splay
    feet[2:, 2] -= back_rake
    return Legs(feet, heads, thickness)


def leg_parts(rng: np.random.Generator, legs: Legs, style: str) -> list[Part]:
    """Build the four legs in one of LEG_STYLES."""
    t = legs.thickness
    end = t * between(rng, 0.35, 0.8)
    turning = rng.random(4)
    bulge = between(rng, 0.02, 0.05)
    parts = []
    for i in range(4):
        foot, head = legs.feet[i], legs.heads[i]
        out = np.array([np.sign(head[0]), 0.0, np.sign(head[2])])
        if style == "square":
            parts.append(frustum((t, t), (t, t), foot, head, "leg"))
        elif style == "tapered":
            parts.append(frustum((end, end), (t, t), foot, head, "leg"))
        elif style == "round":
            parts.append(cylinder(t / 2.0, foot, head, "leg", 12))
        elif style == "cone":
            parts.append(cylinder(end / 2.0, foot, head, "leg", 12, t / 2.0))
        elif style == "turned":
            parts.append(_turned_leg(foot, head, t, turning))
        elif style == "hairpin":
            wide = 0.05 * np.array([out[2], 0.0, -out[0]]) / np.sqrt(2.0)
            low = foot + np.array([0.0, 0.006, 0.0])
            path = rounded_path([head - wide, low - wide * 0.3, low + wide * 0.3, head + wide], 0.02, 2)
            parts.append(sweep(ellipse(0.012, 0.012, 6), path, "leg"))
        else:
            steps = np.linspace(0.0, 1.0, 9)
            line = head + (foot - head) * steps[:, None]
            if style == "sabre":
                line += np.outer(steps**2 * bulge, out) - np.outer(steps * bulge * 0.4, out)
                scales = 1.0 - 0.45 * steps
            else:
                line += np.outer(np.sin(steps * 2.0 * np.pi) * bulge * 0.6, out)
                scales = 1.2 - 0.75 * np.sin(np.pi / 2.0 * steps**0.8)
                scales[-1] = scales[-2] * 1.3
            section = np.array([[1, 1], [-1, 1], [-1, -1], [1, -1]]) * t / 2.0
            parts.append(sweep(section, line, "leg", scales))
    return parts


def _turned_leg(foot: np.ndarray, head: np.ndarray, t: float, turning: np.ndarray) -> Part:
    length = float(np.linalg.norm(head - foot))
    r = t / 2.0
    low, mid = 0.08 + 0.1 * turning[0], 0.45 + 0.2 * turning[1]
    thin = 0.45 + 0.3 * turning[2]
    profile = [
        (r * 0.6, 0.0),
        (r * 0.85, length * low * 0.6),
        (r * thin, length * low),
        (r * (0.8 + 0.3 * turning[3]), length * mid * 0.75),
        (r * thin, length * mid),
        (r * 1.05, length * (mid + 0.06)),
        (r * thin, length * (mid + 0.12)),
        (r, length * 0.82),
        (r, length),
    ]
    leg = lathe(profile, (0.0, 0.0, 0.0), "leg", 10)
    direction = (head - foot) / length
    axis = np.cross((0.0, 1.0, 0.0), direction)
    sine = float(np.linalg.norm(axis))
    if sine > 1e-9:
        leg = leg.rotated(axis, float(np.degrees(np.arcsin(min(sine, 1.0)))))
    return leg.moved(foot)


def stretcher_parts(rng: np.random.Generator, legs: Legs, style: str, low: float, high: float) -> list[Part]:
    """Build bars between the legs in one of STRETCHERS, between fractions `low` and `high` of their height."""
    if style == "none":
        return []
    top = float(legs.heads[0, 1])
    height = top * between(rng, low, high)
    other = float(np.clip(height + top * between(rng, -0.1, 0.1), 0.05 * top, 0.9 * top))
    wide, deep = legs.thickness * between(rng, 0.4, 0.7), legs.thickness * between(rng, 0.5, 0.9)
    round_bar = happens(rng, 0.4)

    def bar(start: np.ndarray, end: np.ndarray) -> Part:
        if round_bar:
            return cylinder(min(wide, deep) / 2.0, start, end, "stretcher", 8)
        return beam(start, end, wide, deep, "stretcher")

    sides = [bar(legs.at(0, height), legs.at(2, height)), bar(legs.at(1, height), legs.at(3, height))]
    if style == "sides":
        return sides
    if style == "h":
        middle = [(legs.at(i, height) + legs.at(i + 2, height)) / 2.0 for i in (0, 1)]
        return [*sides, bar(middle[0], middle[1])]
    if style == "ring":
        return [*sides, bar(legs.at(0, other), legs.at(1, other)), bar(legs.at(2, other), legs.at(3, other))]
    if style == "x":
        return [bar(legs.at(0, height), legs.at(3, height)), bar(legs.at(1, height), legs.at(2, height))]
    parts = [bar(legs.at(0, height), legs.at(1, height))]
    if happens(rng, 0.5):
        parts.append(bar(legs.at(2, height), legs.at(3, height)))
    return parts


def apron_parts(legs: Legs, drop: float, thickness: float) -> list[Part]:
    """Build four boards of height `drop` between the heads of the legs."""
    top = float(legs.heads[0, 1])
    y = top - drop / 2.0
    parts = []
    for i, j in ((0, 1), (2, 3), (0, 2), (1, 3)):
        parts.append(beam(legs.at(i, y), legs.at(j, y), thickness, drop, "apron"))
    return parts


def bracket_feet(width: float, depth: float, height: float, rng: np.random.Generator) -> list[Part]:
    """Build four short feet for upholstered furniture, `height` up to the underside."""
    t = between(rng, 0.03, 0.07)
    if happens(rng, 0.5):
        legs = corner_legs(rng, width, depth, height, t, between(rng, 0.0, 0.02), 0.0, between(rng, 0.0, 0.03))
        return leg_parts(rng, legs, pick(rng, ("square", "tapered", "cone", "round")))
    style = whole(rng, 0, 1)
    if style == 0:
        return [box((width * 0.94, height, depth * 0.92), (0.0, height / 2.0, 0.0), "plinth")]
    return [box((t, height, depth * 0.95), (s * (width / 2.0 - t), height / 2.0, 0.0), "leg") for s in (-1.0, 1.0)]
