"""Families of toilets, bathtubs and sinks."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from kpred.synthetic.chance import between, happens, pick
from kpred.synthetic.organic import vessel
from kpred.synthetic.part import Number
from kpred.synthetic.parts import Part, box, cushion, cylinder, ellipse, frustum, loft, rounded_rectangle, slab, sweep
from kpred.synthetic.paths import rounded_path

Family = Callable[[np.random.Generator], list[Part]]


def _egg(width: Number, length: Number, square: Number = 0.0, segments: int = 24) -> np.ndarray:
    """Return an outline that is narrower in front (+z) and blunt behind; `square` in [0, 1] fills its corners."""
    angles = 2 * np.pi * np.arange(segments) / segments
    x, z = np.cos(angles), np.sin(angles)
    power = 1.0 - 0.5 * square
    x, z = np.sign(x) * np.abs(x) ** power, np.sign(z) * np.abs(z) ** power
    narrow = 1.0 - 0.12 * (1 - square) * z
    return np.column_stack([x * narrow * width / 2, z * length / 2])


def _bowl(
    rng: np.random.Generator, width: Number, length: Number, rim: Number, low: Number, square: Number
) -> list[Part]:
    """Build the bowl's outer body from `low` to the rim, hollow, and a seat ring or closed lid on it."""
    foot = between(rng, 0.5, 0.85)
    plans = [_egg(width * f, length * f, square) for f in (foot, (1 + foot) / 2, 1.0)]
    # The rim lies to the front: a foot of less length stands below its rear.
    plans = [plan - (0, length * (1 - f) * 0.3) for plan, f in zip(plans, (foot, (1 + foot) / 2, 1.0), strict=True)]
    parts = [vessel(plans, [low, low + 0.5 * (rim - low), rim], 0.045, "bowl")]
    lid = slab(_egg(width * 1.02, length * 1.0, square), 0.0, 0.025, "lid")
    if happens(rng, 0.3):
        lid = lid.moved((0, 0, length / 2)).rotated("x", -between(rng, 85, 100)).moved((0, 0.02, -length / 2 + 0.02))
    return [*parts, lid.moved((0, rim + 0.004, 0))]


def close_coupled(rng: np.random.Generator) -> list[Part]:
    """Build a standing toilet with its cistern behind the seat."""
    width, length, rim = between(rng, 0.34, 0.4), between(rng, 0.42, 0.52), between(rng, 0.37, 0.44)
    tall, deep, wide = between(rng, 0.3, 0.42), between(rng, 0.15, 0.22), between(rng, 0.34, 0.46)
    rear = -length / 2 - deep / 2 + 0.03
    parts = _bowl(rng, width, length, rim, 0.0, between(rng, 0.0, 0.8))
    parts.append(box((0.6 * width, rim - 0.02, 0.4 * length), (0, (rim - 0.02) / 2, -0.45 * length), "foot"))
    parts.append(cushion((wide, tall, deep), (0, rim + tall / 2 - 0.02, rear), "cistern", between(rng, 0.01, 0.04), 2))
    parts.append(box((wide + 0.02, 0.03, deep + 0.02), (0, rim + tall - 0.01, rear), "cistern_lid"))
    if happens(rng, 0.5):
        parts.append(cylinder(0.02, (0, rim + tall, rear), (0, rim + tall + 0.015, rear), "button", 10))
    return parts


def wall_hung(rng: np.random.Generator) -> list[Part]:
    """Build a bowl that hangs on a wall or on a boxed cistern."""
    width, length, rim = between(rng, 0.35, 0.39), between(rng, 0.46, 0.56), between(rng, 0.38, 0.44)
    low = rim - between(rng, 0.24, 0.34)
    parts = _bowl(rng, width, length, rim, low, between(rng, 0.2, 1.0))
    if happens(rng, 0.6):
        size = (between(rng, 0.4, 0.9), between(rng, 0.9, 1.2), between(rng, 0.1, 0.2))
        parts.append(box(size, (0, size[1] / 2, -length / 2 - size[2] / 2 + 0.01), "cistern"))
        parts.append(box((0.24, 0.16, 0.01), (0, size[1] - 0.15, -length / 2 + 0.015), "button"))
    else:
        parts.append(box((0.7 * width, rim - low, 0.08), (0, (rim + low) / 2, -length / 2), "foot"))
    return parts


def one_piece(rng: np.random.Generator) -> list[Part]:
    """Build a toilet whose skirt reaches the floor and whose cistern rises from it."""
    width, length, rim = between(rng, 0.35, 0.4), between(rng, 0.66, 0.75), between(rng, 0.36, 0.42)
    square, tall = between(rng, 0.3, 1.0), between(rng, 0.2, 0.38)
    skirt = [
        np.column_stack([p[:, 0], np.full(len(p), y), p[:, 1]])
        for p, y in ((_egg(0.75 * width, 0.88 * length, square), 0.0), (_egg(width, length, square), rim))
    ]
    lid = slab(_egg(width * 1.02, 0.68 * length, square), rim + 0.004, 0.03, "lid").moved((0, 0, 0.16 * length))
    back = cushion((width * 0.95, tall, 0.2), (0, rim + tall / 2 - 0.02, -length / 2 + 0.1), "cistern", 0.04, 2)
    return [loft(np.stack(skirt), "bowl"), lid, back]


def bidet(rng: np.random.Generator) -> list[Part]:
    """Build an open bowl with a tap and without a cistern."""
    width, length, rim = between(rng, 0.34, 0.4), between(rng, 0.5, 0.6), between(rng, 0.36, 0.42)
    plans = [_egg(width * f, length * f, 0.4) for f in (0.6, 0.8, 1.0)]
    parts = [vessel(plans, [0.0, 0.5 * rim, rim], 0.05, "bowl")]
    tap = rounded_path(
        [(0, rim - 0.02, -0.42 * length), (0, rim + 0.12, -0.42 * length), (0, rim + 0.1, -0.15 * length)], 0.04
    )
    return [*parts, sweep(ellipse(0.03, 0.03, 8), tap, "tap")]


def _tub(
    rng: np.random.Generator, outline: Callable[[float, float], np.ndarray], foot: Number, low: Number
) -> list[Part]:
    length, width, height = between(rng, 1.4, 1.9), between(rng, 0.68, 0.9), between(rng, 0.5, 0.65)
    plans = [outline(length * f, width * f) for f in (foot, (1 + 2 * foot) / 3, 1.0)]
    return [vessel(plans, [low, low + 0.35 * (height - low), height], between(rng, 0.03, 0.08), "tub")]


def _tap(rng: np.random.Generator, parts: list[Part]) -> list[Part]:
    low, high = parts[0].vertices.min(axis=0), parts[0].vertices.max(axis=0)
    if happens(rng, 0.4):
        return parts
    x = high[0] - 0.04 if happens(rng, 0.5) else 0.0
    inward = (x - 0.15, 0.0) if x else (0.0, low[2] + 0.17)
    start = (x, 0.0) if x else (0.0, low[2] + 0.03)
    path = [
        (start[0], high[1] - 0.03, start[1]),
        (start[0], high[1] + 0.14, start[1]),
        (inward[0], high[1] + 0.12, inward[1]),
    ]
    return [*parts, sweep(ellipse(0.03, 0.03, 8), rounded_path(path, 0.05), "tap")]


def built_in_tub(rng: np.random.Generator) -> list[Part]:
    """Build a rectangular tub in a panelled box."""
    parts = _tub(rng, lambda a, b: rounded_rectangle(a, b, 0.12, 4), between(rng, 0.75, 0.9), 0.06)
    low, high = parts[0].vertices.min(axis=0), parts[0].vertices.max(axis=0)
    length, width, top = high[0] - low[0], high[2] - low[2], high[1]
    rim = between(rng, 0.02, 0.12)
    for s in (-1, 1):
        parts.append(box((length + 2 * rim, top, rim), (0, top / 2, s * (width + rim) / 2), "panel"))
        parts.append(box((rim, top, width), (s * (length + rim) / 2, top / 2, 0), "panel"))
    return _tap(rng, parts)


def oval_tub(rng: np.random.Generator) -> list[Part]:
    """Build a free-standing oval tub."""
    return _tap(rng, _tub(rng, lambda a, b: ellipse(a, b, 28), between(rng, 0.65, 0.9), 0.0))


def slipper_tub(rng: np.random.Generator) -> list[Part]:
    """Build an oval tub whose ends rise, on feet or a plinth."""
    lift = between(rng, 0.08, 0.16)
    tub = _tub(rng, lambda a, b: ellipse(a, b, 28), between(rng, 0.6, 0.8), lift)[0]
    vertices, reach = tub.vertices.copy(), tub.vertices[:, 0].max()
    ends = (-1, 1) if happens(rng, 0.5) else (-1,)
    along = sum(np.clip(e * vertices[:, 0] / reach, 0, 1) ** 2 for e in ends)
    vertices[:, 1] += np.clip(vertices[:, 1] - lift - 0.15, 0, None) * along * between(rng, 0.2, 0.6)
    parts = [Part(vertices, tub.faces, "tub", tub.axes, tub.ring)]
    if happens(rng, 0.6):
        for x in (-0.5, 0.5):
            for z in (-0.2, 0.2):
                parts.append(
                    frustum((0.05, 0.05), (0.09, 0.09), (x * 1.1 * reach, 0, z), (x * reach, lift + 0.08, z), "leg")
                )
    else:
        parts.append(slab(ellipse(1.1 * reach, 0.4, 24), 0.0, lift + 0.05, "plinth"))
    return parts


def corner_tub(rng: np.random.Generator) -> list[Part]:
    """Build a tub with a bent front that fits a corner."""
    size, height = between(rng, 1.2, 1.5), between(rng, 0.5, 0.6)
    bend = np.radians(np.linspace(0, 90, 9))
    front = np.column_stack([np.cos(bend), np.sin(bend)]) * (0.62, 0.62) - 0.12
    outline = np.concatenate([[[-0.5, -0.5], [0.5, -0.5]], front, [[-0.5, 0.5]]]) * size
    return [vessel([outline * 0.94, outline], [0.0, height], between(rng, 0.08, 0.14), "tub").rotated("y", -45)]


def _basin(rng: np.random.Generator, width: Number, depth: Number, bowl: Number, rim: Number) -> Part:
    round_one = happens(rng, 0.5)
    plans = [
        ellipse(width * f, depth * f, 24) if round_one else rounded_rectangle(width * f, depth * f, 0.06, 3)
        for f in (between(rng, 0.5, 0.9), 1.0)
    ]
    return vessel(plans, [rim - bowl, rim], 0.025, "basin")


def _spout(rng: np.random.Generator, rim: Number, rear: Number) -> Part:
    rise, out = between(rng, 0.12, 0.3), between(rng, 0.1, 0.18)
    path = [
        (0, rim - 0.01, rear),
        (0, rim + rise, rear),
        (0, rim + rise, rear + out),
        (0, rim + rise - 0.05, rear + out),
    ]
    return sweep(ellipse(0.025, 0.025, 8), rounded_path(path, 0.05), "tap")


def pedestal_sink(rng: np.random.Generator) -> list[Part]:
    """Build a basin on a column."""
    width, depth, bowl, rim = (
        between(rng, 0.45, 0.7),
        between(rng, 0.38, 0.5),
        between(rng, 0.13, 0.2),
        between(rng, 0.78, 0.88),
    )
    parts = [_basin(rng, width, depth, bowl, rim), _spout(rng, rim, -0.45 * depth)]
    if happens(rng, 0.5):
        parts.append(cylinder(0.1, (0, 0, -0.03), (0, rim - bowl + 0.02, -0.03), "pedestal", 16, end_radius=0.08))
    else:
        parts.append(frustum((0.2, 0.18), (0.15, 0.14), (0, 0, -0.04), (0, rim - bowl + 0.02, -0.04), "pedestal"))
    return parts


def hanging_sink(rng: np.random.Generator) -> list[Part]:
    """Build a basin alone, as it hangs on a wall or lies in a board, perhaps with a siphon."""
    width, depth, bowl = between(rng, 0.38, 0.75), between(rng, 0.3, 0.5), between(rng, 0.12, 0.22)
    parts = [_basin(rng, width, depth, bowl, bowl), _spout(rng, bowl, -0.44 * depth)]
    if happens(rng, 0.4):
        pipe = rounded_path([(0, 0.02, 0), (0, -0.2, 0), (0, -0.2, -0.45 * depth)], 0.05)
        parts.append(sweep(ellipse(0.04, 0.04, 8), pipe, "siphon"))
    return parts


def vanity(rng: np.random.Generator) -> list[Part]:
    """Build a basin on or in a cabinet with doors or drawers."""
    width, depth, top = between(rng, 0.5, 1.3), between(rng, 0.42, 0.55), between(rng, 0.72, 0.85)
    lift = pick(rng, (0.0, 0.1, 0.3))
    parts = [
        box((width, top - lift, depth), (0, (top + lift) / 2, 0), "body"),
        box((width + 0.02, 0.03, depth + 0.02), (0, top + 0.015, 0), "top"),
    ]
    count = 1 if width < 0.65 else 2
    for k in range(count):
        x = ((k + 0.5) / count - 0.5) * width
        parts.append(
            box((width / count - 0.01, top - lift - 0.02, 0.02), (x, (top + lift) / 2, depth / 2 + 0.01), "door")
        )
        parts.append(box((0.12, 0.015, 0.02), (x, top - 0.08, depth / 2 + 0.03), "handle"))
    basins = (0.0,) if width < 1.0 else (-0.25 * width, 0.25 * width)
    for x in basins:
        bowl = _basin(rng, between(rng, 0.36, 0.46), 0.34, 0.13, top + 0.16)
        parts += [bowl.moved((x, 0, 0.02)), _spout(rng, top + 0.05, -0.43 * depth).moved((x, 0, 0))]
    if lift == 0.1:
        parts += [
            box((0.05, 0.11, 0.05), (a * (width / 2 - 0.04), 0.055, b * (depth / 2 - 0.04)), "leg")
            for a in (-1, 1)
            for b in (-1, 1)
        ]
    return parts


def kitchen_sink(rng: np.random.Generator) -> list[Part]:
    """Build a sheet with one or two sunken basins, perhaps a drainer."""
    width, depth, deep = between(rng, 0.6, 1.2), between(rng, 0.42, 0.55), between(rng, 0.14, 0.22)
    count = 1 if width < 0.75 else pick(rng, (1, 2))
    each = min(0.42, (width - 0.08) / count - 0.04)
    first = -width / 2 + each / 2 + 0.04
    parts = []
    for k in range(count):
        plans = [rounded_rectangle(each * f, (depth - 0.14) * f, 0.05, 3) for f in (0.9, 1.0)]
        parts.append(vessel(plans, [0.0, deep], 0.012, "basin").moved((first + k * (each + 0.04), 0, 0.04)))
    right = first + (count - 0.5) * each + (count - 1) * 0.04
    for x0, x1 in ((right, width / 2), (-width / 2, first - each / 2)):
        parts.append(box((x1 - x0 + 0.01, 0.012, depth), ((x0 + x1) / 2, deep, 0), "sheet"))
    parts.append(box((width, 0.012, 0.11), (0, deep, -depth / 2 + 0.055), "sheet"))
    parts.append(box((width, 0.012, 0.03), (0, deep, depth / 2 - 0.015), "sheet"))
    return [*parts, _spout(rng, deep, -depth / 2 + 0.05)]


TOILET_FAMILIES: dict[str, Family] = {
    "close_coupled": close_coupled,
    "wall_hung": wall_hung,
    "one_piece": one_piece,
    "bidet": bidet,
}
BATHTUB_FAMILIES: dict[str, Family] = {
    "built_in_tub": built_in_tub,
    "oval_tub": oval_tub,
    "slipper_tub": slipper_tub,
    "corner_tub": corner_tub,
}
SINK_FAMILIES: dict[str, Family] = {
    "pedestal_sink": pedestal_sink,
    "hanging_sink": hanging_sink,
    "vanity": vanity,
    "kitchen_sink": kitchen_sink,
}
