"""Storage furniture of few plain boxes, in wilder proportions and with ruder joints than what is sold.

So it looks in models that people draw for games and films: fronts without handles, backs that were left out because
hidden faces, boards as thick as beams. Frame: metres, y up, floor y = 0, doors and open bays towards +z.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from kpred.synthetic.cabinet.fronts import Opening, shelf_board, shelves, upright_board
from kpred.synthetic.chance import between, fractions, happens, pick, whole
from kpred.synthetic.parts import Part, box

Family = Callable[[np.random.Generator], list[Part]]


def proportions(rng: np.random.Generator, forms: str = "tall cube low") -> tuple[float, float, float]:
    """Draw width, height and depth of a case of one of the named forms."""
    form = pick(rng, forms.split())
    if form == "tall":
        height = between(rng, 1.2, 2.2)
        width = height * between(rng, 0.25, 0.8)
        return width, height, float(np.clip(width * between(rng, 0.25, 1.1), 0.2, 0.8))
    if form == "cube":
        height = between(rng, 0.5, 1.3)
        width = height * between(rng, 0.7, 1.3)
        return width, height, float(np.clip(width * between(rng, 0.3, 1.1), 0.2, 0.85))
    height = between(rng, 0.32, 0.95)
    width = min(height * between(rng, 1.4, 4.0), 2.5)
    return width, height, float(np.clip(width * between(rng, 0.2, 0.65), 0.25, 0.85))


def base(rng: np.random.Generator, width: float, depth: float, room: float) -> tuple[list[Part], float]:
    """Build the support of a case, at most `room` high, or nothing; also return its height."""
    kind = pick(rng, ("none", "plinth", "blocks", "legs", "runners", "step"), (3, 2, 2, 2, 0.7, 0.7))
    if kind == "none":
        return [], 0.0
    tall = min(between(rng, 0.03, 0.12), room)
    if kind == "plinth":
        back = pick(rng, (0.0, between(rng, 0.02, 0.08)))
        side = pick(rng, (0.0, between(rng, 0.01, 0.05)))
        return [box((width - 2 * side, tall, depth - back), (0, tall / 2, -back / 2), "plinth")], tall
    if kind == "step":
        out = between(rng, 0.01, 0.05)
        return [box((width + 2 * out, tall, depth + 2 * out), (0, tall / 2, 0), "plinth")], tall
    if kind == "runners":
        wide = width * between(rng, 0.06, 0.15)
        x = (width - wide) / 2 - between(rng, 0.0, 0.2 * width)
        return [box((wide, tall, depth), (side * x, tall / 2, 0), "foot") for side in (-1, 1)], tall
    if kind == "legs":
        tall = min(between(rng, 0.1, 0.45), room)
    size = between(rng, 0.025, 0.1)
    inset = pick(rng, (0.0, between(rng, 0.0, 0.06)))
    x, z = (width - size) / 2 - inset, (depth - size) / 2 - inset
    return [
        box((size, tall, size), (a * x, tall / 2, b * z), "leg" if kind == "legs" else "foot")
        for a in (-1, 1)
        for b in (-1, 1)
    ], tall


def shell(
    rng: np.random.Generator, width: float, depth: float, bottom: float, top: float, back: str, lid: str = "any"
) -> tuple[list[Part], Opening]:
    """Build boards round a space that is open to +z; also return that space.

    `back`: "flush", "inset", "thick" or "none"; `lid`: "inside", "over", "none", or "any" of the first two.
    """
    board = pick(rng, (between(rng, 0.01, 0.03), between(rng, 0.02, 0.07)))
    board = min(board, 0.12 * min(width, top - bottom))
    lid = pick(rng, ("inside", "over")) if lid == "any" else lid
    thick = board * between(rng, 0.8, 2.0) if lid == "over" else board
    head = top - thick if lid == "over" else top
    tall, y = head - bottom, (bottom + head) / 2
    space = Opening(
        -(width - board) / 2,
        (width - board) / 2,
        bottom + board / 2,
        head - (board / 2 if lid == "inside" else 0.0),
        -depth / 2,
        depth / 2,
        board,
    )
    parts = [box((board, tall, depth), (x, y, 0), "side") for x in (space.left, space.right)]
    parts.append(shelf_board(space, space.bottom, "bottom"))
    if lid == "inside":
        parts.append(shelf_board(space, space.top, "top"))
    elif lid == "over":
        over = pick(rng, (0.0, 0.0, between(rng, 0.0, 0.06)))
        behind = pick(rng, (0.0, over))
        size = (width + 2 * over, thick, depth + over + behind)
        parts.append(box(size, (0, head + thick / 2, (over - behind) / 2), "top"))
    if back != "none":
        thin = between(rng, 0.005, 0.02) if back != "thick" else between(rng, 0.02, 0.06)
        set_in = between(rng, 0.02, 0.25) * depth if back == "inset" else 0.0
        parts.append(box((width - board, tall, thin), (0, y, -depth / 2 + set_in + thin / 2), "back"))
        space = replace(space, rear=-depth / 2 + set_in)
    return parts, space


def leaves(rng: np.random.Generator, cell: Opening, kind: str, over: bool, handles: bool) -> list[Part]:
    """Build plain leaves that close a cell: "doors" side by side, "drawers" on each other, or a "grid" of drawers."""
    pitch = between(rng, 0.25, 0.6)
    columns = int(np.clip(round(cell.width / pitch), 1, 4)) if kind != "drawers" else 1
    count = int(np.clip(round(cell.height / between(rng, 0.15, 0.4)), 1, 6)) if kind != "doors" else 1
    gap = pick(rng, (0.001, between(rng, 0.004, 0.016)))
    shrink = min(gap / 2, 0.45 * cell.board) if over else cell.board / 2 - 0.002 + gap / 2
    thick = pick(rng, (between(rng, 0.01, 0.03), between(rng, 0.02, 0.07)))
    rear = cell.front - 0.002 if over else cell.front - thick - pick(rng, (0.0, 0.0, 0.015))
    deep = kind != "doors" and happens(rng, 0.35)
    body = cell.depth * between(rng, 0.5, 0.9)
    rows = cell.rows(fractions(rng, count, pick(rng, (0.0, 0.3))))
    # What stands behind the leaves' edges holds those that touch no board of the case.
    behind = replace(cell, front=cell.front - 0.004)
    parts = [shelf_board(behind, row.bottom, "rail") for row in rows[1:]]
    parts += [upright_board(behind, column.left) for column in cell.columns([1 / columns] * columns)[1:]]
    label = "door" if kind == "doors" else "drawer"
    for one in (leaf for row in rows for leaf in row.columns([1 / columns] * columns)):
        wide, tall = one.width - 2 * shrink, one.height - 2 * shrink
        if min(wide, tall) < 0.02:
            continue
        x, y, _ = one.middle
        parts.append(box((wide, tall, thick), (x, y, rear + thick / 2), label))
        if deep:
            parts.append(box((wide * 0.94, tall * 0.8, body), (x, y, rear + 0.002 - body / 2), label))
        if handles:
            lying = count > 1
            size = (min(0.3 * wide, 0.2), 0.02, 0.03) if lying else (0.02, min(0.3 * tall, 0.3), 0.03)
            shift = 0.0 if lying else 0.4 * wide * (1 if x < cell.middle[0] else -1)
            parts.append(box(size, (x + shift, y, rear + thick + 0.012), "handle"))
    return parts


def closed_case(rng: np.random.Generator) -> list[Part]:
    """Build a box that is closed on all sides, its front of doors or drawers."""
    return _case(rng, proportions(rng), pick(rng, ("flush", "flush", "thick")), "any")


def low_case(rng: np.random.Generator) -> list[Part]:
    """Build a low closed box, wide or square, on the floor or on feet: chest, sideboard, media unit."""
    return _case(rng, proportions(rng, "low low cube"), pick(rng, ("flush", "thick", "none")), "any")


def backless_case(rng: np.random.Generator) -> list[Part]:
    """Build a case closed in front and open behind, where its boards show."""
    return _case(rng, proportions(rng), "none", "any")


def lidless_case(rng: np.random.Generator) -> list[Part]:
    """Build a case without a top: for a basin, or just open."""
    return _case(rng, proportions(rng, "cube low low"), pick(rng, ("flush", "flush", "none")), "none")


def leggy_case(rng: np.random.Generator) -> list[Part]:
    """Build a shallow closed case on four high legs."""
    width, _, depth = proportions(rng, "low cube")
    tall = between(rng, 0.22, 0.6)
    legs = tall * between(rng, 0.25, 0.85)
    size = between(rng, 0.025, 0.08)
    x, z = (width - size) / 2, (depth - size) / 2
    # Legs run up beside the case, or only as far as its bottom.
    top = legs + 0.004 if happens(rng, 0.5) else legs + tall
    parts = [box((size, top, size), (a * x, top / 2, b * z), "leg") for a in (-1, 1) for b in (-1, 1)]
    case, space = shell(rng, width, depth, legs, legs + tall, pick(rng, ("flush", "none", "thick")))
    kind = pick(rng, ("doors", "drawers", "grid"))
    return case + parts + leaves(rng, space, kind, happens(rng, 0.5), happens(rng, 0.3)) + _inside(rng, space)


def _case(rng: np.random.Generator, size: tuple[float, float, float], back: str, lid: str) -> list[Part]:
    width, height, depth = size
    carried, lift = base(rng, width, depth, 0.4 * height)
    parts, space = shell(rng, width, depth, lift, height, back, lid)
    over, handles = happens(rng, 0.55), happens(rng, 0.3)
    cells = [space]
    if happens(rng, 0.4):
        part = between(rng, 0.2, 0.8)
        cells = space.rows([part, 1 - part])
        parts.append(shelf_board(cells[1], cells[1].bottom))
    elif happens(rng, 0.3):
        cells = space.columns(fractions(rng, whole(rng, 2, 3), 0.4))
        parts += [upright_board(cell, cell.left) for cell in cells[1:]]
    for cell in cells:
        parts += leaves(rng, cell, pick(rng, ("doors", "drawers", "grid"), (3, 2, 1)), over, handles)
    if back == "none" or lid == "none":
        parts += [part for cell in cells for part in _inside(rng, cell)]
    return parts + carried


def _inside(rng: np.random.Generator, cell: Opening) -> list[Part]:
    """Build boards behind the leaves."""
    inner = replace(cell, front=cell.front - 0.075)
    return shelves(rng, inner, int(np.clip(round(cell.height / between(rng, 0.2, 0.6)) - 1, 0, 6)), 0.2)


COARSE_CASES: dict[str, Family] = {
    "closed_case": closed_case,
    "low_case": low_case,
    "backless_case": backless_case,
    "lidless_case": lidless_case,
    "leggy_case": leggy_case,
}
