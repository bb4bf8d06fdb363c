"""Shelves and half-open cases of few plain boxes: thick boards, face frames, bays of all sizes, doors ajar.

Frame: metres, y up, floor y = 0, open bays towards +z.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from kpred.synthetic.cabinet.fronts import Opening, shelf_board, shelves, upright_board
from kpred.synthetic.chance import between, fractions, happens, pick, whole
from kpred.synthetic.coarse.cabinets import base, leaves, proportions, shell
from kpred.synthetic.parts import Part, box

Family = Callable[[np.random.Generator], list[Part]]


def _boards(rng: np.random.Generator, cell: Opening, spacing: tuple[float, float] = (0.15, 0.5)) -> list[Part]:
    count = int(np.clip(round(cell.height / between(rng, *spacing)) - 1, 0, 8))
    return shelves(rng, cell, count, pick(rng, (0.0, 0.3)))


def plain_shelf(rng: np.random.Generator) -> list[Part]:
    """Build an open bookcase: one or more columns of boards, with or without a back."""
    width, height, depth = proportions(rng, "tall tall cube low")
    depth = min(depth, 0.5)
    carried, lift = base(rng, width, depth, 0.25 * height)
    back = pick(rng, ("flush", "thick", "inset", "none"), (3, 2, 1, 2))
    parts, space = shell(rng, width, depth, lift, height, back)
    cells = space.columns(fractions(rng, int(np.clip(round(width / between(rng, 0.35, 0.9)), 1, 4)), 0.3))
    parts += [upright_board(cell, cell.left) for cell in cells[1:]]
    level = happens(rng, 0.5)
    seed = int(rng.integers(2**31))
    for cell in cells:
        parts += _boards(np.random.default_rng(seed) if level else rng, cell)
    return parts + carried


def framed_shelf(rng: np.random.Generator) -> list[Part]:
    """Build bays behind a face frame of broad posts and rails; the back is closed."""
    width, height, depth = proportions(rng, "tall tall cube")
    carried, lift = base(rng, width, depth, 0.2 * height)
    parts, space = shell(rng, width, depth, lift, height, pick(rng, ("flush", "thick")))
    post, rail = width * between(rng, 0.06, 0.16), height * between(rng, 0.02, 0.07)
    deep = between(rng, 0.015, 0.06)
    z = depth / 2 + deep / 2 - 0.002
    tall = height - lift
    parts += [box((post, tall, deep), (s * (width - post) / 2, lift + tall / 2, z), "stile") for s in (-1, 1)]
    rows = int(np.clip(round(height / between(rng, 0.22, 0.5)), 1, 7))
    for index, row in enumerate(space.rows(fractions(rng, rows, 0.2))):
        if index:
            parts.append(shelf_board(row, row.bottom))
        y = max(row.bottom, lift + rail / 2)
        parts.append(box((width - 2 * post + 0.004, rail, deep), (0, y, z), "rail"))
    wide = rail * between(rng, 1.0, 3.0)
    parts.append(box((width - 2 * post + 0.004, wide, deep), (0, height - wide / 2, z), "rail"))
    return parts + carried


def half_open(rng: np.random.Generator) -> list[Part]:
    """Build rows or columns, some closed by leaves and others open."""
    width, height, depth = proportions(rng)
    carried, lift = base(rng, width, depth, 0.3 * height)
    parts, space = shell(rng, width, depth, lift, height, pick(rng, ("flush", "thick", "none"), (3, 1, 1)))
    count = whole(rng, 2, 3)
    if happens(rng, 0.5 if width > height else 0.15):
        cells = space.columns(fractions(rng, count, 0.5))
        parts += [upright_board(cell, cell.left) for cell in cells[1:]]
    else:
        cells = space.rows(fractions(rng, count, 0.5))
        parts += [shelf_board(cell, cell.bottom) for cell in cells[1:]]
    over, handles = happens(rng, 0.5), happens(rng, 0.3)
    closed = int(rng.integers(count))
    for index, cell in enumerate(cells):
        if index == closed or happens(rng, 0.25):
            parts += leaves(rng, cell, pick(rng, ("doors", "drawers", "grid")), over, handles)
        else:
            parts += _boards(rng, cell, (0.25, 0.7))
    return parts + carried


def case_ajar(rng: np.random.Generator) -> list[Part]:
    """Build a case whose doors stand open, or one of whose drawers is pulled out."""
    width, height, depth = proportions(rng, "tall cube")
    parts, space = shell(rng, width, depth, 0.0, height, pick(rng, ("flush", "thick")))
    parts += _boards(rng, space)
    if happens(rng, 0.3):
        tall = height * between(rng, 0.15, 0.35)
        y = between(rng, 0.3, 0.8) * height
        body = (width - 2 * space.board, tall, depth)
        return [*parts, box(body, (0, y, depth * between(rng, 0.3, 0.8)), "drawer")]
    leaf = width / 2 if happens(rng, 0.7) else width
    thick = between(rng, 0.012, 0.04)
    for side in (-1, 1) if leaf < width else (pick(rng, (-1, 1)),):
        hinge = side * (width - thick) / 2
        open_leaf = box((leaf, height, thick), (hinge - side * (leaf - thick) / 2, height / 2, depth / 2), "door")
        degrees = side * between(rng, 15, 100)
        parts.append(open_leaf.rotated("y", degrees, (hinge, 0, depth / 2)))
    return parts


def stacked_cases(rng: np.random.Generator) -> list[Part]:
    """Build two cases on each other, the upper one narrower, shallower or jutting out."""
    width, height, depth = proportions(rng, "tall tall cube")
    part = between(rng, 0.25, 0.7) * height
    back = pick(rng, ("flush", "flush", "none"))
    parts, space = shell(rng, width, depth, 0.0, part, back)
    parts += leaves(rng, space, pick(rng, ("doors", "drawers", "grid")), happens(rng, 0.5), happens(rng, 0.3))
    wide, deep = (
        width * pick(rng, (1.0, 1.0, between(rng, 0.6, 0.98))),
        depth * pick(rng, (between(rng, 0.5, 1.0), 1.0)),
    )
    upper, room = shell(rng, wide, deep, part - 0.002, height, back)
    if happens(rng, 0.5):
        upper += leaves(rng, room, pick(rng, ("doors", "drawers")), happens(rng, 0.5), happens(rng, 0.3))
    else:
        upper += _boards(rng, room)
    shift = -(depth - deep) / 2
    return parts + [one.moved((0, 0, shift)) for one in upper]


def post_shelf(rng: np.random.Generator) -> list[Part]:
    """Build boards between four corner posts or two pairs of side frames."""
    width, height, depth = proportions(rng, "tall tall cube low")
    depth = float(np.clip(depth, 0.25, 0.6))
    post = between(rng, 0.015, 0.07)
    x, z = (width - post) / 2, (depth - post) / 2
    parts = [box((post, height, post), (a * x, height / 2, b * z), "post") for a in (-1, 1) for b in (-1, 1)]
    rows, thick = whole(rng, 3, 6), between(rng, 0.012, 0.05)
    first = between(rng, 0.02, 0.15) * height
    last = height - pick(rng, (thick / 2, between(rng, 0.02, 0.15) * height))
    for y in np.linspace(first, last, rows):
        parts.append(box((width, thick, depth), (0, float(y), 0), "shelf"))
    if happens(rng, 0.3):
        parts.append(box((width - post, height * 0.9, 0.01), (0, height * 0.5, -depth / 2 + 0.006), "back"))
    return parts


def low_bench(rng: np.random.Generator) -> list[Part]:
    """Build a low unit of two or three levels for a screen, parts of it closed, its levels of different widths."""
    width, depth = between(rng, 0.9, 2.4), between(rng, 0.3, 0.6)
    thick = between(rng, 0.02, 0.07)
    levels = whole(rng, 2, 3)
    rise = between(rng, 0.14, 0.3)
    lift = between(rng, 0.0, 0.12)
    parts: list[Part] = []
    if lift > 0.03:
        parts.append(box((width * 0.8, lift + 0.004, depth * 0.8), (0, lift / 2 + 0.002, 0), "plinth"))
    else:
        lift = 0.0
    narrow = pick(rng, (1.0, between(rng, 0.5, 0.95)))
    shift = (1 - narrow) * width / 2 * pick(rng, (-1, 0, 1))
    for level in range(levels):
        wide, x = (width, 0.0) if level < levels - 1 else (width * narrow, shift)
        y = lift + thick / 2 + level * rise
        parts.append(box((wide, thick, depth), (x, y, 0), "shelf" if level < levels - 1 else "top"))
        if level == levels - 1:
            continue
        above, off = (width, 0.0) if level + 1 < levels - 1 else (width * narrow, shift)
        bays = whole(rng, 1, 3)
        for index in range(bays + 1):
            at = off + (above - thick) * (index / bays - 0.5)
            parts.append(box((thick, rise, depth), (at, y + rise / 2, 0), "divider"))
        cell = Opening(
            off - above / 2 + thick / 2, off + above / 2 - thick / 2, y, y + rise, -depth / 2, depth / 2, thick
        )
        if happens(rng, 0.5):
            part = pick(rng, (1.0, between(rng, 0.3, 0.6)))
            closed = replace(cell, right=cell.left + cell.width * part)
            parts += leaves(rng, closed, pick(rng, ("doors", "grid")), True, happens(rng, 0.3))
        if happens(rng, 0.5):
            parts.append(box((above, rise, 0.012), (off, y + rise / 2, -depth / 2 + 0.006), "back"))
    return [part.mirrored_x() for part in parts] if happens(rng, 0.5) else parts


COARSE_SHELVES: dict[str, Family] = {
    "plain_shelf": plain_shelf,
    "framed_shelf": framed_shelf,
    "half_open": half_open,
    "case_ajar": case_ajar,
    "stacked_cases": stacked_cases,
    "post_shelf": post_shelf,
    "low_bench": low_bench,
}
