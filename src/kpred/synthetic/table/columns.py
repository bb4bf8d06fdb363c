"""Tables on columns, tripods and sculpted bases."""

from __future__ import annotations

import numpy as np

from kpred.synthetic.chance import between, happens, pick, whole
from kpred.synthetic.parts import Part, beam, box, cylinder, ellipse, frustum, lathe, slab, sweep
from kpred.synthetic.table.legged import long_side_front
from kpred.synthetic.table.tops import any_top_shape, cut_corners, tabletop


def _square(width: float, depth: float) -> np.ndarray:
    return np.array([(width, depth), (-width, depth), (-width, -depth), (width, -depth)]) / 2


def column(rng: np.random.Generator, head: float, foot: float, center: tuple[float, float]) -> list[Part]:
    """Build one column with its foot, floor to `head`; `foot` is the foot's radius, `center` (x, z)."""
    x, z = center
    radius = between(rng, 0.025, 0.06) * (0.6 + foot)
    kind = pick(rng, ("disc", "turned", "cone", "star", "square", "flare"))
    plate = [cylinder(foot * 0.45, (x, head - 0.015, z), (x, head, z), "mount", 12)]
    if kind == "disc":
        return plate + [
            cylinder(foot, (x, 0, z), (x, 0.02, z), "foot", 24),
            cylinder(radius, (x, 0.01, z), (x, head, z), "column", 14),
        ]
    if kind == "cone":
        return [cylinder(foot, (x, 0, z), (x, head, z), "column", 20, foot * between(rng, 0.25, 1.0))]
    if kind == "flare":
        steps = np.linspace(0, 1, 9)
        profile = [
            (float(radius + (foot - radius) * (abs(2 * t - 1) ** 3) * (1 if t < 0.5 else 0.6)), float(t * head))
            for t in steps
        ]
        return [lathe(profile, (x, 0, z), "column", 20)]
    if kind == "square":
        side = 2 * radius
        return plate + [
            frustum((2 * foot, 2 * foot), (1.7 * foot, 1.7 * foot), (x, 0, z), (x, 0.05, z), "foot"),
            box((side, head - 0.04, side), (x, (head + 0.04) / 2, z), "column"),
        ]
    if kind == "turned":
        r = radius * 1.2
        profile = [
            (r, 0.12 * head),
            (1.9 * r, 0.2 * head),
            (1.6 * r, 0.3 * head),
            (0.8 * r, 0.4 * head),
            (1.2 * r, 0.6 * head),
            (1.5 * r, 0.75 * head),
            (0.9 * r, 0.85 * head),
            (1.8 * r, head),
        ]
        parts = plate + [lathe(profile, (x, 0, z), "column", 14)]
    else:
        parts = plate + [cylinder(radius, (x, 0.04, z), (x, head, z), "column", 14)]
    arms = 5 if kind == "star" and happens(rng, 0.3) else pick(rng, (3, 4, 4))
    for angle in 2 * np.pi * (np.arange(arms) / arms) + np.pi / 4:
        out = np.array([np.cos(angle), np.sin(angle)]) * foot * 1.1
        if kind == "star":
            parts.append(beam((x, 0.055, z), (x + out[0], 0.02, z + out[1]), 0.05, 0.04, "foot"))
            continue
        path = np.array(
            [[x + out[0] * t, head * (0.26 * (1 - t) ** 1.5) + 0.02, z + out[1] * t] for t in (0, 0.25, 0.5, 0.8, 1)]
        )
        section = np.array([(0.02, 0.03), (-0.02, 0.03), (-0.02, -0.03), (0.02, -0.03)])
        parts.append(sweep(section, path, "foot", scales=[1.2, 1.1, 1, 0.9, 0.65]))
    return parts


def pedestal_table(rng: np.random.Generator) -> list[Part]:
    """Build one column under a round, square or oval top: bistro, tulip and dining tables of any height."""
    size = between(rng, 0.4, 1.5)
    height = pick(
        rng, (between(rng, 0.4, 0.6), between(rng, 0.68, 0.78), between(rng, 0.7, 0.76), between(rng, 0.95, 1.1))
    )
    thick = between(rng, 0.012, 0.045)
    depth = size / (between(rng, 1.1, 1.5) if happens(rng, 0.25) else 1.0)
    outline = pick(
        rng, (ellipse(size, depth, 32), _square(size, depth), cut_corners(size, depth, 0.29 * depth)), (4, 1.5, 1)
    )
    return [slab(outline, height - thick, thick, "top")] + column(
        rng, height - thick, depth * between(rng, 0.25, 0.4), (0.0, 0.0)
    )


def double_pedestal_table(rng: np.random.Generator) -> list[Part]:
    """Build two equal columns under a long top."""
    width = between(rng, 1.4, 2.6)
    depth, height, thick = width / between(rng, 1.7, 2.8), between(rng, 0.7, 0.78), between(rng, 0.02, 0.06)
    parts = tabletop(rng, width, depth, height, thick, any_top_shape(rng, 0.5))
    apart = width * between(rng, 0.2, 0.3)
    base = column(rng, height - thick, min(depth * between(rng, 0.25, 0.38), apart * 0.8), (0.0, 0.0))
    parts += [part.moved((-apart, 0, 0)) for part in base] + [part.moved((-apart, 0, 0)).mirrored_x() for part in base]
    if happens(rng, 0.3):
        parts.append(beam((-apart, height * 0.3, 0), (apart, height * 0.3, 0), 0.04, 0.06, "stretcher"))
    return parts


def tripod_table(rng: np.random.Generator) -> list[Part]:
    """Build a small top on three slanted rods, which meet in the middle or cross."""
    size, height, thick = between(rng, 0.35, 0.8), between(rng, 0.4, 0.75), between(rng, 0.012, 0.035)
    head, rod = height - thick, between(rng, 0.012, 0.022)
    foot, top = size / 2 * between(rng, 0.75, 1.1), size / 2 * between(rng, 0.1, 0.6)
    crossed = happens(rng, 0.4)
    parts = [slab(ellipse(size, size, 28), head, thick, "top")]
    shift = np.pi * 0.8 if crossed else 0.0
    for angle in 2 * np.pi * np.arange(3) / 3 + np.pi / 2:
        low, high = np.array([np.cos(angle), np.sin(angle)]), np.array([np.cos(angle + shift), np.sin(angle + shift)])
        parts.append(
            cylinder(rod, (low[0] * foot, 0, low[1] * foot), (high[0] * top, head, high[1] * top), "leg", 8, rod * 1.2)
        )
    if not crossed and happens(rng, 0.4):
        t = between(rng, 0.3, 0.5)
        radius = foot + (top - foot) * t
        parts.append(slab(ellipse(2.1 * radius, 2.1 * radius, 20), head * t, 0.015, "shelf"))
    return long_side_front(parts)


def sculpted_table(rng: np.random.Generator) -> list[Part]:
    """Build a thin (glass) top on a sculpted base: ribbon, crossing blades, leaning loops, spheres, vase."""
    width = between(rng, 0.7, 1.8)
    depth = float(np.clip(width / between(rng, 1.0, 2.2), 0.55, 1.1))
    height, thick = pick(rng, (between(rng, 0.33, 0.48), between(rng, 0.7, 0.76))), between(rng, 0.008, 0.02)
    head, span = height - thick, 0.62 * width
    shape = pick(rng, ("oval", "rounded", "rectangle", "superellipse"))
    parts = tabletop(rng, width, depth, height, thick, shape)
    form = pick(rng, ("ribbon", "blades", "loops", "vase", "fan"))
    deep = depth * 0.55
    if form == "ribbon":
        return parts + _ribbon(rng, span, head, deep)
    if form == "blades":
        for angle in np.array([0.0, between(rng, 50, 110)]) + between(rng, 10, 45):
            blade = frustum((span * 0.95, 0.03), (span * between(rng, 0.4, 0.9), 0.03), (0, 0, 0), (0, head, 0), "base")
            parts.append(blade.rotated("y", float(angle)))
        return parts
    if form == "loops":
        return parts + _leaning_loops(span, head, deep)
    if form == "vase":
        return parts + _vase(rng, 0.3 * depth, head)
    for t in np.linspace(-1, 1, whole(rng, 4, 7)):
        parts.append(
            beam((t * span * 0.12, 0, -t * deep * 0.5), (t * span / 2, head, t * deep * 0.5), 0.03, 0.05, "leg")
        )
    return [*parts, box((span * 0.4, 0.02, deep * 1.1), (0, 0.01, 0), "foot")]


def _ribbon(rng: np.random.Generator, span: float, head: float, deep: float) -> list[Part]:
    """Build a sheet bent into waves from the floor to height `head`, with a plate at either end."""
    rise = np.linspace(0, 1, 17)
    middle = np.stack([np.sin(rise * 2 * np.pi * pick(rng, (0.5, 0.75, 1.0))) * span / 2, rise * head], axis=1)
    slope = np.gradient(middle, axis=0)
    normal = np.stack([-slope[:, 1], slope[:, 0]], axis=1) / np.linalg.norm(slope, axis=1, keepdims=True)
    outline = np.concatenate([middle + 0.018 * normal, (middle - 0.018 * normal)[::-1]])
    outline[:, 1] = np.clip(outline[:, 1], 0, head)
    ribbon = [slab(outline, -deep / 2, deep, "base").rotated("x", -90.0)]
    for x, y in ((middle[0, 0], 0.01), (middle[-1, 0], head - 0.01)):
        ribbon.append(box((0.35 * span, 0.02, deep), (float(x), y, 0), "base"))
    shift = float((middle[0, 0] + middle[-1, 0]) / 2)
    return [part.moved((-shift, 0, 0)) for part in ribbon]


def _leaning_loops(span: float, head: float, deep: float) -> list[Part]:
    """Build two frames of crossing bars, each joined by a bar between front and rear."""
    parts = []
    for side in (-1, 1):
        for z in (-1, 1):
            for low, high in ((side * span * 0.15, side * span / 2), (side * span * 0.5, side * span * 0.15)):
                parts.append(beam((low, 0, z * deep / 2), (high, head, z * deep / 2), 0.04, 0.04, "leg"))
        parts.append(box((0.04, 0.03, deep), (side * span * 0.32, head * 0.5, 0), "stretcher"))
    return parts


def _vase(rng: np.random.Generator, radius: float, head: float) -> list[Part]:
    """Build a turned body of waves with a plate on it."""
    steps = np.linspace(0, 1, 10)
    wave = 0.55 + 0.45 * np.cos(steps * 2 * np.pi * pick(rng, (0.5, 1.0)))
    line = [(float(radius * w), float(head * t)) for w, t in zip(wave + 0.1, steps, strict=True)]
    return [
        lathe(line, (0, 0, 0), "base", 24),
        cylinder(radius * 0.8, (0, head - 0.012, 0), (0, head, 0), "mount", 20),
    ]
