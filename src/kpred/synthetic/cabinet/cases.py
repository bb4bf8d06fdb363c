"""Tall closed storage: wardrobes, lockers, cupboards, filing and shoe cabinets."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from kpred.synthetic.cabinet.bodies import any_support, carcass, crown, divided, fill, lifted, support
from kpred.synthetic.cabinet.fronts import (
    FrontStyle,
    any_front_style,
    door,
    doors,
    drawer,
    drawers,
    shelf_board,
    upright_board,
)
from kpred.synthetic.chance import between, fractions, happens, pick, whole
from kpred.synthetic.parts import Part, box, cylinder, frustum


def wardrobe(rng: np.random.Generator) -> list[Part]:
    """Build one to four hinged doors over the whole height, or over drawers."""
    count = pick(rng, (1, 2, 2, 3, 4))
    width, depth = between(rng, 0.38, 0.56) * count, between(rng, 0.48, 0.66)
    height, board, style = between(rng, 1.6, 2.3), between(rng, 0.015, 0.03), any_front_style(rng)
    kind, lift = any_support(rng, high=0.15)
    parts, space = carcass(width, depth, lift, height, board)
    parts += support(rng, width, depth, lift, kind) + crown(rng, width, depth, height)
    form = pick(rng, ("doors", "doors", "drawers", "flank"))
    if form == "drawers":
        low, space = space.rows([(part := between(rng, 0.12, 0.3)), 1 - part])
        parts.append(shelf_board(space, space.bottom))
        parts += drawers(rng, low, style, 1 if low.height < 0.35 else 2, pick(rng, (1, max(1, count // 2))))
    if form == "flank" and count >= 3:
        cells = space.columns([1 / count] * count)
        parts += [upright_board(cell, cell.left) for cell in (cells[1], cells[-1])]
        middle = replace(cells[1], right=cells[-2].right)
        parts += door(cells[0], style, -1) + door(cells[-1], style, 1)
        low, high = middle.rows([(part := between(rng, 0.35, 0.55)), 1 - part])
        parts += [shelf_board(high, high.bottom), *drawers(rng, low, style, whole(rng, 2, 4))]
        return parts + fill(rng, high, style, ("doors", "shelves"))
    if count >= 3:
        cells = space.columns([1 / count] * count)
        parts.append(upright_board(cells[2], cells[2].left))
    return parts + doors(space, style, count)


def sliding_wardrobe(rng: np.random.Generator) -> list[Part]:
    """Build two or three wide doors in two tracks, one behind the other."""
    width, depth, height = between(rng, 1.2, 2.4), between(rng, 0.55, 0.7), between(rng, 1.9, 2.3)
    board, count = between(rng, 0.015, 0.03), whole(rng, 2, 3)
    style = replace(any_front_style(rng), inset=True, handle=pick(rng, ("none", "bar", "edge")), thickness=0.02)
    lift = pick(rng, (0.0, 0.06))
    parts, space = carcass(width, depth, lift, height, board)
    parts += support(rng, width, depth, lift, "plinth") + crown(rng, width, depth, height, 0.3)
    edge = 0.5 * board
    for index, cell in enumerate(space.columns([1 / count] * count)):
        leaf = replace(
            cell,
            left=cell.left - edge * (index > 0),
            right=cell.right + edge * (index < count - 1),
            front=cell.front - 0.024 * (index % 2),
        )
        parts += door(leaf, style, -1 if index else 1)
    return parts


def wall_cabinet(rng: np.random.Generator) -> list[Part]:
    """Build a shallow hung cabinet with hinged doors, a lift-up flap, or glass; sometimes an open shelf."""
    width, depth, height = between(rng, 0.4, 1.6), between(rng, 0.25, 0.38), between(rng, 0.4, 0.95)
    board, style = between(rng, 0.015, 0.022), any_front_style(rng)
    parts, space = carcass(width, depth, 0.0, height, board)
    parts += crown(rng, width, depth, height, 0.3)
    if happens(rng, 0.3):
        low, space = space.rows([(part := between(rng, 0.2, 0.35)), 1 - part])
        parts.append(shelf_board(space, space.bottom))
    if width > height * 1.4 and happens(rng, 0.4):
        return parts + drawer(space, style)
    boards, cells = divided(rng, space, max(1, round(width / 0.7)))
    for cell in cells:
        parts += fill(rng, cell, style, ("doors", "glass", "shelves"), (5, 2, 0.7))
    return parts + boards


def tall_cabinet(rng: np.random.Generator) -> list[Part]:
    """Build a narrow, high cabinet: doors, drawers and open parts above each other."""
    width, depth, height = between(rng, 0.3, 0.6), between(rng, 0.28, 0.6), between(rng, 1.3, 2.3)
    board, style = between(rng, 0.015, 0.03), any_front_style(rng)
    kind, lift = any_support(rng, high=0.16)
    parts, space = carcass(width, depth, lift, height, board)
    parts += support(rng, width, depth, lift, kind) + crown(rng, width, depth, height, 0.4)
    rows = space.rows(fractions(rng, whole(rng, 2, 4), 0.5))
    parts += [shelf_board(row, row.bottom) for row in rows[1:]]
    for index, row in enumerate(rows):
        parts += fill(rng, row, style, ("doors", "shelves", "drawers", "glass"), (3, 1.5, 1.5 if index < 2 else 0.0, 1))
    return parts


def filing_cabinet(rng: np.random.Generator) -> list[Part]:
    """Build two to five equal high drawers in one or two columns, with thin metal sides."""
    rows, columns = whole(rng, 2, 5), pick(rng, (1, 1, 1, 2))
    width, depth, height = (
        between(rng, 0.38, 0.5) * columns,
        between(rng, 0.45, 0.7),
        between(rng, 0.27, 0.34) * rows + 0.05,
    )
    style = replace(any_front_style(rng), panel="flat", handle=pick(rng, ("bar", "cup", "rod", "edge")), gap=0.008)
    parts, space = carcass(width, depth, 0.0, height, 0.014)
    parts += drawers(rng, space, style, rows, columns)
    if style.handle != "edge" and not style.inset:
        for row in space.rows([1 / rows] * rows):
            for cell in row.columns([1 / columns] * columns):
                face = cell.front + style.thickness
                parts.append(box((0.08, 0.04, 0.006), (cell.middle[0], cell.top - 0.055, face), "holder"))
    if happens(rng, 0.25):
        wheels = [
            cylinder(0.025, (x - 0.01, 0.025, z), (x + 0.01, 0.025, z), "wheel", 10)
            for x in (-width * 0.4, width * 0.4)
            for z in (-depth * 0.4, depth * 0.4)
        ]
        return lifted(parts, 0.048) + wheels
    return parts


def cornice_cabinet(rng: np.random.Generator) -> list[Part]:
    """Build a classical cupboard: plinth, framed doors, corner pilasters, a large cornice."""
    width, depth, height = between(rng, 0.8, 1.6), between(rng, 0.4, 0.6), between(rng, 1.0, 2.2)
    style = replace(any_front_style(rng), panel=pick(rng, ("framed", "raised")), inset=False)
    base, tall, out = between(rng, 0.08, 0.16), between(rng, 0.06, 0.14), between(rng, 0.04, 0.09)
    parts, space = carcass(width, depth, base, height - tall, 0.025)
    parts.append(box((width + 0.04, base, depth + 0.03), (0, base / 2, 0.01), "plinth"))
    parts.append(
        frustum(
            (width + 0.02, depth + 0.02),
            (width + 2 * out, depth + out),
            (0, height - tall - 0.001, 0),
            (0, height, out / 2),
            "cornice",
        )
    )
    wide = between(rng, 0.04, 0.08)
    for side in (-1, 1):
        x = side * (width - wide) / 2
        parts.append(
            box((wide, height - tall - base, 0.02), (x, (height - tall + base) / 2, depth / 2 + 0.009), "pilaster")
        )
    inner = replace(space, left=space.left + wide - 0.012, right=space.right - wide + 0.012)
    if happens(rng, 0.5):
        low, high = inner.rows([(part := between(rng, 0.15, 0.35)), 1 - part])
        parts += [shelf_board(high, high.bottom), *drawers(rng, low, style, 1, pick(rng, (1, 2)))]
        return parts + fill(rng, high, style, ("doors", "glass"), (3, 1))
    return parts + doors(inner, style, 2 if width < 1.3 else pick(rng, (2, 3)))


def shoe_cabinet(rng: np.random.Generator) -> list[Part]:
    """Build a shallow cabinet with tip-out fronts that stand slanted in their openings."""
    width, depth, rows = between(rng, 0.5, 1.1), between(rng, 0.2, 0.35), whole(rng, 2, 4)
    height, board = between(rng, 0.36, 0.5) * rows, between(rng, 0.015, 0.022)
    style = replace(any_front_style(rng), panel=pick(rng, ("flat", "slatted")), inset=True)
    lift = pick(rng, (0.0, 0.06))
    parts, space = carcass(width, depth, lift, height, board)
    parts += support(rng, width, depth, lift, "feet") + crown(rng, width, depth, height, 0.5)
    columns = pick(rng, (1, 1, 2)) if width > 0.8 else 1
    slant = between(rng, 4, 14)
    for row in space.rows([1 / rows] * rows):
        if row.bottom > space.bottom + 0.01:
            parts.append(shelf_board(row, row.bottom))
        for index, cell in enumerate(row.columns([1 / columns] * columns)):
            if index:
                parts.append(upright_board(cell, cell.left))
            hinge = (0.0, cell.bottom + board / 2, cell.front)
            parts += [part.rotated("x", slant, hinge) for part in drawer(cell, style)]
    return parts


def locker(rng: np.random.Generator) -> list[Part]:
    """Build columns of narrow doors, one to four in each column, with vents."""
    columns, rows = whole(rng, 1, 5), whole(rng, 1, 4)
    width, depth, height = between(rng, 0.28, 0.38) * columns, between(rng, 0.35, 0.5), between(rng, 1.6, 2.0)
    style = FrontStyle(happens(rng, 0.5), 0.018, "flat", pick(rng, ("knob", "bar", "square_knob")), 0.8, 0.008)
    lift = pick(rng, (0.0, 0.08))
    parts, space = carcass(width, depth, lift, height, 0.016)
    parts += support(rng, width, depth, lift, pick(rng, ("plinth", "feet")))
    boards, cells = divided(rng, space, columns)
    parts += boards
    for cell in cells:
        for row in cell.rows([1 / rows] * rows):
            if row.bottom > space.bottom + 0.01:
                parts.append(shelf_board(replace(row, front=row.front - 0.022), row.bottom))
            parts += door(row, style, -1)
            face = row.front + (0.0 if style.inset else style.thickness)
            for k in range(1 if columns * rows > 9 else 3):
                parts.append(
                    box((row.width * 0.5, 0.008, 0.006), (row.middle[0], row.top - 0.07 - 0.03 * k, face), "vent")
                )
    return parts
