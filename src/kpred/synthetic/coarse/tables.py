"""Tables of few plain boxes: thick aprons and legs, panels, tiers, cases under a top, blocks down to the floor.

Frame: metres, y up, floor y = 0, the sitter's side or a long side towards +z.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from kpred.synthetic.cabinet.fronts import Opening
from kpred.synthetic.chance import between, happens, pick, whole
from kpred.synthetic.coarse.cabinets import leaves
from kpred.synthetic.parts import Part, beam, box, splayed_legs

Family = Callable[[np.random.Generator], list[Part]]


def table_size(rng: np.random.Generator, forms: str = "square oblong long high") -> tuple[float, float, float]:
    """Draw width, height and depth of a table of one of the named forms, width the larger side."""
    form = pick(rng, forms.split())
    if form == "square":
        width = between(rng, 0.45, 1.4)
        return width, width * between(rng, 0.28, 1.2), width * pick(rng, (1.0, between(rng, 0.85, 1.0)))
    if form == "oblong":
        width = between(rng, 0.7, 2.0)
        return width, width * between(rng, 0.25, 0.65), width * between(rng, 0.4, 0.85)
    if form == "long":
        width = between(rng, 1.2, 2.6)
        return width, width * between(rng, 0.2, 0.45), width * between(rng, 0.25, 0.5)
    width = between(rng, 0.4, 0.9)
    return width, width * between(rng, 0.9, 1.8), width * between(rng, 0.5, 1.0)


def _bounded(size: tuple[float, float, float]) -> tuple[float, float, float]:
    width, height, depth = size
    return width, float(np.clip(height, 0.3, 1.25)), max(depth, 0.3)


def _top(rng: np.random.Generator, width: float, height: float, depth: float) -> tuple[list[Part], float]:
    """Build a top, sometimes a frame without its pane; also return the height of its lower face."""
    thick = height * pick(rng, (between(rng, 0.02, 0.06), between(rng, 0.04, 0.2)))
    y = height - thick / 2
    if happens(rng, 0.06):
        rim = between(rng, 0.03, 0.1) * depth
        return [
            *(box((width, thick, rim), (0, y, s * (depth - rim) / 2), "top") for s in (-1, 1)),
            *(box((rim, thick, depth), (s * (width - rim) / 2, y, 0), "top") for s in (-1, 1)),
        ], height - thick
    parts = [box((width, thick, depth), (0, y, 0), "top")]
    if happens(rng, 0.12):
        # A layer on it that is smaller, or one that juts out.
        grow = between(rng, -0.15, 0.06)
        size = (width * (1 + grow), thick * between(rng, 0.2, 0.6), depth * (1 + grow))
        parts.append(box(size, (0, height + size[1] / 2 - 0.002, 0), "top"))
    return parts, height - thick


def _corner_posts(
    rng: np.random.Generator, width: float, depth: float, head: float, size: float, inset: float, straight: bool = False
) -> list[Part]:
    """Build four legs of square or oblong section, their outer faces `inset` from the top's edges."""
    deep = size * pick(rng, (1.0, 1.0, between(rng, 0.4, 2.0)))
    x, z = (width - size) / 2 - inset, (depth - deep) / 2 - inset
    out = 0.0 if straight else pick(rng, (0.0, 0.0, between(rng, -0.1, 0.15))) * head
    taper = 1.0 if straight else pick(rng, (1.0, 1.0, between(rng, 0.4, 1.2)))
    return splayed_legs((x, z), out, (size * taper, deep * taper), (size, deep), head + 0.002)


def post_table(rng: np.random.Generator) -> list[Part]:
    """Build four posts, thin to very thick, with or without an apron and bars or boards below it."""
    width, height, depth = _bounded(table_size(rng))
    parts, head = _top(rng, width, height, depth)
    size = min(width, depth) * pick(rng, (between(rng, 0.03, 0.1), between(rng, 0.08, 0.28)))
    inset = pick(rng, (0.0, 0.0, between(rng, 0.02, 0.2))) * depth
    inset = min(inset, depth / 2 - 0.8 * size)
    barred = happens(rng, 0.35)
    parts += _corner_posts(rng, width, depth, head, size, max(inset, 0.0), barred)
    x, z = width / 2 - max(inset, 0) - size / 2, depth / 2 - max(inset, 0) - size / 2
    if happens(rng, 0.55):
        tall = head * between(rng, 0.06, 0.3)
        bar = min(size * between(rng, 0.2, 0.9), 0.06)
        y = head - tall / 2 + 0.002
        parts += [box((2 * x, tall, bar), (0, y, s * z), "apron") for s in (-1, 1)]
        parts += [box((bar, tall, 2 * z), (s * x, y, 0), "apron") for s in (-1, 1)]
    if barred:
        y, bar = head * between(rng, 0.05, 0.45), between(rng, 0.02, 0.05)
        kind = pick(rng, ("ring", "sides", "h", "cross"))
        if kind == "cross":
            parts += [beam((-x, y, -s * z), (x, y, s * z), bar, bar, "stretcher") for s in (-1, 1)]
        else:
            parts += [box((bar, bar, 2 * z), (s * x, y, 0), "stretcher") for s in (-1, 1)]
        if kind == "ring":
            parts += [box((2 * x, bar, bar), (0, y, s * z), "stretcher") for s in (-1, 1)]
        if kind == "h":
            parts.append(box((2 * x, bar, bar), (0, y, 0), "stretcher"))
    return parts


def tier_table(rng: np.random.Generator) -> list[Part]:
    """Build posts with one to three boards below the top; the lowest may lie on the floor."""
    width, height, depth = _bounded(table_size(rng, "square oblong oblong high"))
    parts, head = _top(rng, width, height, depth)
    size = min(width, depth) * between(rng, 0.03, 0.16)
    inset = pick(rng, (0.0, between(rng, 0.0, 0.1))) * depth
    parts += _corner_posts(rng, width, depth, head, size, inset, True)
    wide, deep = width - 2 * inset - size * 0.6, depth - 2 * inset - size * 0.6
    count = pick(rng, (1, 1, 1, 2, 3)) if height > 0.5 * width else 1
    thick = between(rng, 0.012, 0.06) * height
    first = head * pick(rng, (between(rng, 0.02, 0.1), between(rng, 0.1, 0.45)))
    for index in range(count):
        y = first + (head - first) * index / count
        parts.append(box((wide, thick, deep), (0, y + thick / 2, 0), "shelf"))
    if happens(rng, 0.25):
        tall = (head - first) / count * between(rng, 0.3, 0.7)
        parts.append(box((wide, tall, deep * 0.96), (0, head - tall / 2, 0), "drawer"))
    return parts


def panel_table(rng: np.random.Generator) -> list[Part]:
    """Build two panels as legs, with or without a panel at the back, a shelf or a bar between them."""
    width, height, depth = _bounded(table_size(rng, "square oblong long long"))
    parts, head = _top(rng, width, height, depth)
    thick = width * pick(rng, (between(rng, 0.012, 0.04), between(rng, 0.03, 0.18)))
    inset = pick(rng, (0.0, 0.0, between(rng, 0.02, 0.22))) * width
    deep = depth * pick(rng, (1.0, between(rng, 0.4, 1.0)))
    x = (width - thick) / 2 - inset
    parts += [box((thick, head + 0.002, deep), (s * x, head / 2, 0), "side") for s in (-1, 1)]
    if happens(rng, 0.6):
        tall = head * between(rng, 0.15, 1.0)
        board = pick(rng, (0.016, between(rng, 0.02, 0.06)))
        z = -deep / 2 + board / 2 + pick(rng, (0.0, between(rng, 0.0, 0.5))) * (deep - board)
        parts.append(box((2 * x, tall, board), (0, head - tall / 2, z), "panel"))
    if happens(rng, 0.35):
        y = head * between(rng, 0.05, 0.75)
        parts.append(box((2 * x, height * between(rng, 0.02, 0.08), deep * 0.95), (0, y, 0), "shelf"))
    if happens(rng, 0.2):
        parts.append(box((2 * x, between(rng, 0.05, 0.12), 0.03), (0, head * between(rng, 0.1, 0.6), 0), "stretcher"))
    if happens(rng, 0.15):
        parts.append(box((thick, head, deep), (x * between(rng, -0.5, 0.5), head / 2, 0), "divider"))
    return parts


def block_table(rng: np.random.Generator) -> list[Part]:
    """Build a block down to the floor under a top that juts out over it, or does not: counters, altars, cubes."""
    width, height, depth = _bounded(table_size(rng, "square square oblong long"))
    parts, head = _top(rng, width, height, depth)
    over = pick(rng, (0.0, between(rng, 0.02, 0.1), between(rng, 0.1, 0.3))) * depth
    wide, deep = width - 2 * over, depth - 2 * over
    if happens(rng, 0.45):
        parts.append(box((wide, head + 0.002, deep), (0, head / 2, 0), "block"))
    else:
        # A wall all round without a side towards the sitter.
        wall = between(rng, 0.015, 0.06) * width
        parts += [box((wall, head + 0.002, deep), (s * (wide - wall) / 2, head / 2, 0), "side") for s in (-1, 1)]
        parts.append(box((wide, head + 0.002, wall), (0, head / 2, -(deep - wall) / 2), "panel"))
        if happens(rng, 0.4):
            y = head * between(rng, 0.3, 0.8)
            parts.append(box((wide, 0.03, deep * 0.7), (0, y, -deep * 0.14), "shelf"))
    if happens(rng, 0.2):
        out = between(rng, 0.0, 0.08) * width
        tall = head * between(rng, 0.05, 0.15)
        parts.append(box((wide + 2 * out, tall, deep + 2 * out), (0, tall / 2, 0), "plinth"))
    if happens(rng, 0.15):
        # A ledge for guests on the side away from the sitter.
        tall, part = height * between(rng, 0.1, 0.4), depth * between(rng, 0.2, 0.45)
        parts.append(box((width, tall, part), (0, height + tall / 2 - 0.002, -(depth - part) / 2), "ledge"))
    return parts


def drawer_table(rng: np.random.Generator) -> list[Part]:
    """Build a case as a thick apron between top and legs, with drawers in its front or open to it."""
    width, height, depth = _bounded(table_size(rng, "square oblong long high"))
    parts, head = _top(rng, width, height, depth)
    over = pick(rng, (0.0, between(rng, 0.01, 0.08))) * depth
    wide, deep = width - 2 * over, depth - 2 * over
    tall = head * between(rng, 0.12, 0.4)
    low, board = head - tall, between(rng, 0.012, 0.03)
    parts += [box((board, tall + 0.002, deep), (s * (wide - board) / 2, low + tall / 2, 0), "apron") for s in (-1, 1)]
    parts.append(box((wide, tall + 0.002, board), (0, low + tall / 2, -(deep - board) / 2), "apron"))
    parts.append(box((wide, board, deep), (0, low + board / 2, 0), "bottom"))
    front = Opening(-(wide - board) / 2, (wide - board) / 2, low + board / 2, head, -deep / 2, deep / 2, board)
    if happens(rng, 0.8):
        parts += leaves(rng, front, pick(rng, ("doors", "grid")), True, happens(rng, 0.4))
    size = min(wide, deep) * between(rng, 0.04, 0.15)
    up = pick(rng, (low + 0.002, head))
    shelf = happens(rng, 0.3)
    parts += _corner_posts(rng, wide, deep, up, size, 0.0, shelf)
    if shelf:
        y = low * between(rng, 0.1, 0.5)
        parts.append(box((wide - size, 0.025, deep - size), (0, y, 0), "shelf"))
    return parts


def cased_desk(rng: np.random.Generator) -> list[Part]:
    """Build cases at one or both ends under a top, with legs or a panel at a free end."""
    width, height, depth = _bounded(table_size(rng, "oblong long"))
    parts, head = _top(rng, width, height, depth)
    board, case = between(rng, 0.012, 0.04), width * between(rng, 0.18, 0.38)
    lift = head * pick(rng, (0.0, between(rng, 0.05, 0.5)))
    both = happens(rng, 0.5)
    for side in (-1, 1) if both else (1,):
        x = side * (width - case) / 2
        cell = Opening(x - case / 2 + board / 2, x + case / 2 - board / 2, lift, head, -depth / 2, depth / 2, board)
        parts += [
            box((board, head - lift, depth), (at, (lift + head) / 2, 0), "side") for at in (cell.left, cell.right)
        ]
        parts.append(box((case, board, depth), (x, lift + board / 2, 0), "bottom"))
        if happens(rng, 0.8):
            parts.append(box((case, head - lift, board), (x, (lift + head) / 2, -(depth - board) / 2), "back"))
        if happens(rng, 0.75):
            parts += leaves(rng, cell, pick(rng, ("doors", "drawers")), True, happens(rng, 0.4))
        elif happens(rng, 0.7):
            parts += [box((case, board, depth), (x, lift + (head - lift) * k / 3, 0), "shelf") for k in (1, 2)]
    if lift:
        size = between(rng, 0.03, 0.07)
        parts += _corner_posts(rng, width, depth, head, size, 0.0)
    elif not both:
        thick = between(rng, 0.02, 0.06)
        parts.append(box((thick, head, depth), (-(width - thick) / 2, head / 2, 0), "side"))
    if happens(rng, 0.45):
        tall = head * between(rng, 0.3, 1.0)
        parts.append(box((width * 0.98, tall, board), (0, head - tall / 2, -depth / 2 + board * 1.5), "panel"))
    if happens(rng, 0.15):
        tall, part = height * between(rng, 0.15, 0.6), depth * between(rng, 0.2, 0.4)
        parts.append(box((width, tall, part), (0, height + tall / 2 - 0.002, -(depth - part) / 2), "hutch"))
    return [part.mirrored_x() for part in parts] if happens(rng, 0.5) else parts


def column_table(rng: np.random.Generator) -> list[Part]:
    """Build one or two columns or T-shaped legs, on plates, crosses or bars."""
    width, height, depth = _bounded(table_size(rng))
    parts, head = _top(rng, width, height, depth)
    count = 2 if width > 1.2 * depth and happens(rng, 0.75) else 1
    foot = min(0.3 * head, height * between(rng, 0.02, 0.15))
    wide = depth * pick(rng, (between(rng, 0.04, 0.15), between(rng, 0.1, 0.5)))
    deep = wide * pick(rng, (1.0, between(rng, 0.3, 2.0)))
    deep = min(deep, 0.8 * depth)
    spread = width * between(rng, 0.2, 0.42) if count == 2 else 0.0
    kind = pick(rng, ("plate", "bar", "cross", "none"))
    for x in (-spread, spread) if count == 2 else (0.0,):
        parts.append(box((wide, head + 0.002, deep), (x, head / 2, 0), "column"))
        reach = depth * between(rng, 0.55, 1.0)
        if kind == "plate":
            side = reach if count == 1 else max(wide, reach * 0.4)
            parts.append(box((side, foot, reach), (x, foot / 2, 0), "foot"))
        elif kind == "bar" and count == 2:
            parts.append(box((max(wide, 0.04), foot, reach), (x, foot / 2, 0), "foot"))
        elif kind != "none":
            bar = max(0.5 * wide, 0.03)
            turn = pick(rng, (0.0, 45.0))
            for degrees in (turn, turn + 90):
                parts.append(box((reach, foot, bar), (x, foot / 2, 0), "foot").rotated("y", degrees, (x, 0, 0)))
    if count == 2 and happens(rng, 0.5):
        parts.append(box((2 * spread, 0.05, 0.03), (0, head * between(rng, 0.1, 0.8), 0), "stretcher"))
    return parts


def cluster_table(rng: np.random.Generator) -> list[Part]:
    """Build a top on a base that is not at its corners: inner legs, crossing panels, a smaller box."""
    width, height, depth = _bounded(table_size(rng))
    parts, head = _top(rng, width, height, depth)
    small = between(rng, 0.3, 0.75)
    kind = pick(rng, ("legs", "cross", "ring", "steps"))
    if kind == "legs":
        size = depth * between(rng, 0.05, 0.14)
        return parts + _corner_posts(rng, width * small + size, depth * small + size, head, size, 0.0)
    if kind == "cross":
        thick = between(rng, 0.02, 0.08) * width
        turn = pick(rng, (0.0, between(rng, 20, 60)))
        walls = [box((width * small, head, thick), (0, head / 2, 0), "panel")]
        walls.append(box((thick, head, depth * small), (0, head / 2, 0), "panel"))
        return parts + [wall.rotated("y", turn) for wall in walls]
    if kind == "ring":
        wall, wide, deep = between(rng, 0.02, 0.08) * width, width * small, depth * small
        parts += [box((wall, head, deep), (s * (wide - wall) / 2, head / 2, 0), "panel") for s in (-1, 1)]
        return parts + [box((wide, head, wall), (0, head / 2, s * (deep - wall) / 2), "panel") for s in (-1, 1)]
    low = 0.0
    count = whole(rng, 2, 3)
    for index in range(count):
        fraction = between(rng, 0.3, 0.95)
        tall = head / count
        parts.append(box((width * fraction, tall + 0.004, depth * fraction), (0, low + tall / 2, 0), f"block_{index}"))
        low += tall
    return parts


COARSE_TABLES: dict[str, Family] = {
    "post_table": post_table,
    "tier_table": tier_table,
    "panel_table": panel_table,
    "block_table": block_table,
    "drawer_table": drawer_table,
    "cased_desk": cased_desk,
    "column_table": column_table,
    "cluster_table": cluster_table,
}
