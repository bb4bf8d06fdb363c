"""Open storage: bookcases, cube grids, ladder shelves, racks and their kin."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from kpred.synthetic.cabinet.bodies import any_support, carcass, crown, divided, fill, support
from kpred.synthetic.cabinet.fronts import Opening, any_front_style, shelf_board, shelves, upright_board
from kpred.synthetic.chance import between, fractions, happens, pick, whole
from kpred.synthetic.parts import Part, beam, box, cylinder


def open_bookcase(rng: np.random.Generator) -> list[Part]:
    """Build one to three columns of shelves, with or without a back, at equal or different heights."""
    columns = pick(rng, (1, 1, 1, 2, 2, 3))
    width, depth = between(rng, 0.4, 0.95) * (1 + 0.75 * (columns - 1)), between(rng, 0.22, 0.4)
    height, board = between(rng, 0.7, 2.3), between(rng, 0.015, 0.035)
    kind, lift = any_support(rng, high=0.12)
    parts, space = carcass(width, depth, lift, height, board, back=happens(rng, 0.65))
    parts += support(rng, width, depth, lift, kind) + crown(rng, width, depth, height, 0.35)
    boards, cells = divided(rng, space, columns)
    count, uneven = max(1, round(height / between(rng, 0.28, 0.42)) - 1), pick(rng, (0.0, 0.2, 0.35))
    heights = fractions(rng, count + 1, uneven)
    for cell in cells:
        if happens(rng, 0.25):
            heights = fractions(rng, max(2, count + 1 - whole(rng, 0, 1)), uneven)
        parts += [shelf_board(row, row.bottom) for row in cell.rows(heights)[1:]]
    return parts + boards


def cube_grid(rng: np.random.Generator) -> list[Part]:
    """Build n x m square bays, open to both sides or backed; some with boxes, doors or drawers."""
    columns, rows = whole(rng, 1, 5), whole(rng, 1, 5)
    if columns * rows < 3:
        columns, rows = pick(rng, ((3, 2), (2, 3), (2, 2)))
    cube, depth = between(rng, 0.28, 0.4), between(rng, 0.28, 0.42)
    cube = min(cube, 2.3 / max(columns, rows))
    board = between(rng, 0.014, 0.04)
    kind, lift = any_support(rng, high=0.14) if happens(rng, 0.35) else ("none", 0.0)
    width, height = cube * columns, lift + cube * rows
    parts, space = carcass(width, depth, lift, height, board, back=happens(rng, 0.45))
    parts += support(rng, width, depth, lift, kind)
    style = replace(any_front_style(rng), inset=True, panel="flat")
    closed = pick(rng, (0.0, 0.0, 0.25, 0.5))
    boards, cells = divided(rng, space, columns)
    for cell in cells:
        for index, row in enumerate(cell.rows([1 / rows] * rows)):
            if index:
                parts.append(shelf_board(row, row.bottom))
            if happens(rng, closed):
                parts += fill(rng, row, style, ("doors", "drawers"))
    return parts + boards


def stepped_bookcase(rng: np.random.Generator) -> list[Part]:
    """Build columns of falling height, like stairs or towers of blocks."""
    columns, depth = whole(rng, 2, 5), between(rng, 0.25, 0.4)
    wide, tall, board = between(rng, 0.28, 0.45), between(rng, 0.28, 0.4), between(rng, 0.015, 0.035)
    form = pick(rng, ("stairs", "tower", "valley"))
    steps = np.arange(columns)
    counts = {
        "stairs": steps + 1,
        "tower": columns - np.abs(2 * steps - columns + 1) // 2,
        "valley": 1 + np.abs(2 * steps - columns + 1) // 2,
    }[form]
    counts = np.minimum(counts, 6)
    left, back = -wide * columns / 2, happens(rng, 0.5)
    edges = [0, *counts, 0]
    parts: list[Part] = []
    for k in range(columns + 1):
        high = max(edges[k], edges[k + 1]) * tall
        parts.append(
            box((board, high, depth), (left + k * wide, high / 2, 0), "side" if k in (0, columns) else "divider")
        )
    style = replace(any_front_style(rng), inset=True)
    for k, count in enumerate(counts):
        space = Opening(
            left + k * wide, left + (k + 1) * wide, board / 2, count * tall - board / 2, -depth / 2, depth / 2, board
        )
        for index, row in enumerate(space.rows([1 / count] * count)):
            parts.append(shelf_board(row, row.bottom, "shelf" if index else "bottom"))
            if happens(rng, 0.12):
                parts += fill(rng, row, style, ("doors", "drawers"))
        parts.append(shelf_board(space, space.top, "top"))
        if back:
            parts.append(box((wide, space.height, 0.008), (*space.middle[:2], -depth / 2 + 0.004), "back"))
    return [part.mirrored_x() for part in parts] if happens(rng, 0.5) else parts


def ladder_shelf(rng: np.random.Generator) -> list[Part]:
    """Build leaning side rails that meet a wall behind, with shelves that grow deeper towards the floor."""
    width, height, depth = between(rng, 0.45, 1.0), between(rng, 1.3, 2.1), between(rng, 0.35, 0.6)
    count, bar, top = whole(rng, 3, 6), between(rng, 0.025, 0.045), between(rng, 0.12, 0.22)
    rear = -depth / 2
    framed = happens(rng, 0.5)
    parts: list[Part] = []
    for side in (-1, 1):
        x = side * (width - bar) / 2
        parts.append(beam((x, 0, depth / 2 - bar), (x, height, rear + top * 0.6), bar, bar * 1.6, "rail"))
        if framed:
            parts.append(box((bar, height, bar), (x, height / 2, rear + bar / 2), "post"))
    for y in np.linspace(0.12, height * 0.93, count):
        front = depth / 2 - bar + (rear + top * 0.6 - depth / 2 + bar) * float(y) / height
        deep = front - rear
        parts.append(box((width - bar, 0.02, deep), (0, float(y), rear + deep / 2), "shelf"))
        if happens(rng, 0.5):
            parts.append(box((width - bar, 0.06, 0.012), (0, float(y) + 0.03, rear + 0.006), "rim"))
    return parts


def rack(rng: np.random.Generator) -> list[Part]:
    """Build four or six posts with boards, wire levels or lattice, braces behind."""
    width, depth, height = between(rng, 0.45, 1.8), between(rng, 0.28, 0.6), between(rng, 0.7, 2.1)
    count, post = max(2, round(height / between(rng, 0.3, 0.5))), between(rng, 0.018, 0.05)
    bays = 2 if width > 1.3 and happens(rng, 0.6) else 1
    x, z = (width - post) / 2, (depth - post) / 2
    round_post, parts = happens(rng, 0.35), []
    for at in np.linspace(-x, x, bays + 1):
        for side in (-1, 1):
            if round_post:
                parts.append(cylinder(post / 2, (float(at), 0, side * z), (float(at), height, side * z), "post", 10))
            else:
                parts.append(box((post, height, post), (float(at), height / 2, side * z), "post"))
    kind = pick(rng, ("board", "board", "wire", "slats"))
    thick = between(rng, 0.015, 0.035)
    low, high = between(rng, 0.05, 0.25), height - pick(rng, (0.01 + thick / 2, 0.12))
    for y in np.linspace(low, high, count):
        y = float(y)
        if kind == "board":
            parts.append(box((width - post * 0.5, thick, depth - post * 0.5), (0, y, 0), "shelf"))
            continue
        for side in (-1, 1):
            parts.append(box((2 * x, 0.02, 0.012), (0, y, side * z), "shelf"))
            parts.append(box((0.012, 0.02, 2 * z), (side * x, y, 0), "shelf"))
        if kind == "wire":
            for t in np.linspace(-1, 1, 9)[1:-1]:
                parts.append(box((0.006, 0.006, 2 * z), (float(t) * x, y + 0.006, 0), "shelf"))
        else:
            for t in np.linspace(-0.85, 0.85, 4):
                parts.append(box((2 * x, 0.012, depth * 0.15), (0, y + 0.012, float(t) * z), "shelf"))
    if happens(rng, 0.45):
        brace = min(height * 0.9, width * 1.3)
        for side in (-1, 1):
            parts.append(beam((-side * x, 0.06, -z - 0.003), (side * x, brace, -z - 0.003), 0.006, 0.02, "brace"))
    if happens(rng, 0.2):
        parts.append(box((2 * x, height - low, 0.008), (0, (height + low) / 2, -depth / 2 + 0.004), "back"))
    return parts


def asymmetric_shelf(rng: np.random.Generator) -> list[Part]:
    """Build a case split again and again at unequal places; the cells are open, closed by doors, or drawers."""
    width, depth, height = between(rng, 0.7, 2.3), between(rng, 0.28, 0.45), between(rng, 0.6, 2.1)
    board, style = between(rng, 0.016, 0.032), any_front_style(rng)
    kind, lift = any_support(rng, high=0.2)
    parts, space = carcass(width, depth, lift, height, board, back=happens(rng, 0.75))
    parts += support(rng, width, depth, lift, kind) + crown(rng, width, depth, height, 0.3)
    cells, goal = [space], whole(rng, 4, 7)
    closed = between(rng, 0.1, 0.7)
    while len(cells) < goal:
        index = int(np.argmax([cell.width * cell.height for cell in cells]))
        cell, cut = cells.pop(index), between(rng, 0.32, 0.68)
        if cell.width > cell.height * between(rng, 0.7, 1.4):
            first, second = cell.columns([cut, 1 - cut])
            parts.append(upright_board(second, second.left))
        else:
            first, second = cell.rows([cut, 1 - cut])
            parts.append(shelf_board(second, second.bottom))
        cells += [first, second]
    for cell in cells:
        if happens(rng, closed) and min(cell.width, cell.height) > 0.12:
            parts += fill(rng, cell, style, ("doors", "drawers", "glass"), (3, 2, 0.7))
        elif cell.height > 0.6:
            parts += shelves(rng, cell, round(cell.height / 0.38) - 1)
    return parts


def bookcase_with_doors(rng: np.random.Generator) -> list[Part]:
    """Open shelves above, doors or drawers below (or in the middle)."""
    columns = pick(rng, (1, 1, 2, 3))
    width, depth = between(rng, 0.5, 0.95) * (1 + 0.65 * (columns - 1)), between(rng, 0.28, 0.45)
    height, board, style = between(rng, 1.2, 2.3), between(rng, 0.016, 0.03), any_front_style(rng)
    kind, lift = any_support(rng, high=0.15)
    parts, space = carcass(width, depth, lift, height, board)
    parts += support(rng, width, depth, lift, kind) + crown(rng, width, depth, height, 0.5)
    boards, cells = divided(rng, space, columns)
    part, middle, below = between(rng, 0.22, 0.48), happens(rng, 0.2), pick(rng, ("doors", "drawers", "mixed"))
    count = whole(rng, 1, 4)
    for cell in cells:
        rows = cell.rows([0.3, part * 0.8, 0.7 - part * 0.8] if middle else [part, 1 - part])
        parts += [shelf_board(row, row.bottom) for row in rows[1:]]
        parts += fill(rng, rows[1] if middle else rows[0], style, (below,))
        parts += shelves(rng, rows[-1], min(count, max(0, int(rows[-1].height / 0.2) - 1)))
    return parts + boards
