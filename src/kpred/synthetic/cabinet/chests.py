"""Low closed storage: chests of drawers, sideboards, TV stands, kitchen units, nightstands, secretaries."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from kpred.synthetic.cabinet.bodies import any_support, carcass, crown, divided, fill, support
from kpred.synthetic.cabinet.fronts import (
    Opening,
    any_front_style,
    doors,
    drawer,
    drawers,
    shelf_board,
    upright_board,
)
from kpred.synthetic.chance import between, happens, pick, whole
from kpred.synthetic.parts import Part, box, slab


def _board(rng: np.random.Generator) -> float:
    return between(rng, 0.015, 0.03)


def chest_of_drawers(rng: np.random.Generator) -> list[Part]:
    """Build n x m drawers, equal, graded, or with small ones in the top row; low to high."""
    form = pick(rng, ("wide", "tall", "plain"))
    columns = {"wide": whole(rng, 2, 3), "tall": 1, "plain": pick(rng, (1, 1, 2))}[form]
    rows = {"wide": whole(rng, 2, 4), "tall": whole(rng, 5, 7), "plain": whole(rng, 3, 5)}[form]
    width = between(rng, 0.45, 0.65) * columns + (0.25 if form == "plain" and columns == 1 else 0.0)
    height, depth = between(rng, 0.17, 0.24) * rows + 0.1, between(rng, 0.36, 0.55)
    board, style = _board(rng), any_front_style(rng)
    kind, lift = any_support(rng, high=0.18)
    parts, space = carcass(width, depth, lift, height, board)
    parts += support(rng, width, depth, lift, kind) + crown(rng, width, depth, height, 0.7)
    if happens(rng, 0.3):
        low, high = space.rows([1 - 0.8 / rows, 0.8 / rows])
        parts += [shelf_board(high, high.bottom), *drawers(rng, high, style, 1, columns + 1)]
        return parts + drawers(rng, low, style, rows - 1, columns, happens(rng, 0.4))
    if columns == 3 and happens(rng, 0.4):
        cells = space.columns([0.3, 0.4, 0.3])
        parts += [upright_board(cell, cell.left) for cell in cells[1:]]
        for cell, count in zip(cells, (rows, max(2, rows - 1), rows), strict=True):
            parts += drawers(rng, cell, style, count)
        return parts
    parts += drawers(rng, space, style, rows, columns, happens(rng, 0.4))
    if happens(rng, 0.12):
        tall, wide = between(rng, 0.5, 0.8), width * between(rng, 0.5, 0.8)
        parts.append(box((wide, tall, 0.03), (0, height + tall / 2 - 0.001, -depth / 2 + 0.03), "mirror"))
    return parts


def sideboard(rng: np.random.Generator) -> list[Part]:
    """Build columns of doors, drawers and open bays in a low case on legs or a plinth."""
    width, depth, height = between(rng, 1.0, 2.3), between(rng, 0.36, 0.55), between(rng, 0.65, 1.0)
    board, style = _board(rng), any_front_style(rng)
    kind, lift = any_support(rng, high=0.28)
    parts, space = carcass(width, depth, lift, height, board)
    parts += support(rng, width, depth, lift, kind) + crown(rng, width, depth, height, 0.6)
    if happens(rng, 0.35):
        count = whole(rng, 2, 4)
        low, high = space.rows([(part := between(rng, 0.65, 0.8)), 1 - part])
        parts += [shelf_board(high, high.bottom), *drawers(rng, high, style, 1, count)]
        boards, cells = divided(rng, low, max(1, count // 2))
        parts += boards
        for cell in cells:
            parts += fill(rng, cell, style, ("doors",))
        return parts
    count = whole(rng, 2, 4)
    boards, cells = divided(rng, space, count, 0.25)
    kinds = [pick(rng, ("doors", "drawers", "shelves", "mixed", "glass"), (4, 3, 1, 2, 0.7)) for _ in cells]
    if happens(rng, 0.6):
        kinds[count // 2 :] = kinds[: count - count // 2][::-1]
        cells = space.columns([1 / count] * count)
        boards = [upright_board(cell, cell.left) for cell in cells[1:]]
    for cell, filling in zip(cells, kinds, strict=True):
        parts += fill(rng, cell, style, (filling,))
    return parts + boards


def tv_stand(rng: np.random.Generator) -> list[Part]:
    """Build a low, wide case: open bays in the middle or above, drawers or doors beside or below."""
    width, depth, height = between(rng, 0.9, 2.2), between(rng, 0.32, 0.5), between(rng, 0.35, 0.65)
    board, style = between(rng, 0.018, 0.035), any_front_style(rng)
    kind, lift = any_support(rng, high=0.16)
    parts, space = carcass(width, depth, lift, height, board, back=happens(rng, 0.75))
    parts += support(rng, width, depth, lift, kind) + crown(rng, width, depth, height, 0.3)
    form = pick(rng, ("flank", "stacked", "open"))
    if form == "stacked":
        low, high = space.rows([(part := between(rng, 0.45, 0.65)), 1 - part])
        low, high = (low, high) if happens(rng, 0.75) else (high, low)
        parts.append(shelf_board(space, max(low.bottom, high.bottom)))
        parts += (
            drawers(rng, low, style, 1, whole(rng, 1, 3)) if happens(rng, 0.6) else doors(low, style, whole(rng, 2, 4))
        )
        boards, _ = divided(rng, high, whole(rng, 1, 3))
        return parts + boards
    boards, cells = divided(rng, space, 3 if form == "flank" else whole(rng, 2, 4), 0.2 if form == "open" else 0.0)
    parts += boards
    beside = pick(rng, ("doors", "drawers", "glass"))
    for index, cell in enumerate(cells):
        if form == "flank" and index != 1:
            parts += fill(rng, cell, style, (beside,))
        elif happens(rng, 0.6):
            parts.append(shelf_board(cell, cell.bottom + cell.height * between(rng, 0.4, 0.65), setback=0.02))
    return parts


def kitchen_base(rng: np.random.Generator) -> list[Part]:
    """Build one to four units under a worktop with a recessed toe kick; drawers above doors in most."""
    count = whole(rng, 1, 4)
    width, depth, height = between(rng, 0.4, 0.6) * count, between(rng, 0.55, 0.63), between(rng, 0.82, 0.92)
    worktop, kick, style = between(rng, 0.025, 0.045), between(rng, 0.08, 0.15), any_front_style(rng)
    case = height - worktop
    parts, space = carcass(width, depth, kick, case, 0.018)
    parts.append(box((width, kick, depth - 0.06), (0, kick / 2, -0.03), "plinth"))
    parts.append(
        box((width + pick(rng, (0.0, 0.03)), worktop, depth + 0.03), (0, case + worktop / 2, 0.015), "worktop")
    )
    boards, cells = divided(rng, space, count)
    parts += boards
    for cell in cells:
        parts += fill(rng, cell, style, ("mixed", "doors", "drawers"), (3, 1.5, 1.5))
    if happens(rng, 0.3):
        tall = between(rng, 0.06, 0.4)
        parts.append(box((width, tall, 0.015), (0, height + tall / 2 - 0.001, -depth / 2 + 0.0075), "splash"))
    return parts


def nightstand(rng: np.random.Generator) -> list[Part]:
    """Build a small case with one to three drawers, a door, or a drawer over an open bay."""
    width, height = between(rng, 0.35, 0.65), between(rng, 0.4, 0.75)
    depth = between(rng, 0.3, 0.48)
    board, style = _board(rng), any_front_style(rng)
    kind, lift = any_support(rng, high=0.22)
    parts, space = carcass(width, depth, lift, height, board, back=happens(rng, 0.85))
    parts += support(rng, width, depth, lift, kind) + crown(rng, width, depth, height, 0.5)
    form = pick(rng, ("drawers", "bay", "door", "mixed"))
    if form == "drawers":
        return parts + drawers(rng, space, style, whole(rng, 1, 3))
    if form == "door":
        return parts + doors(space, style, 1)
    if form == "mixed":
        return parts + fill(rng, space, style, ("mixed",))
    low, high = space.rows([(part := between(rng, 0.45, 0.7)), 1 - part])
    if happens(rng, 0.3):
        low, high = high, low
    parts.append(shelf_board(space, max(low.bottom, high.bottom)))
    return parts + drawers(rng, high, style, 1)


def secretary(rng: np.random.Generator) -> list[Part]:
    """Build drawers, a slanted writing flap above them, and sometimes a bookcase or doors on top."""
    width, depth, low = between(rng, 0.7, 1.1), between(rng, 0.4, 0.55), between(rng, 0.68, 0.78)
    board, style = 0.02, any_front_style(rng)
    kind, lift = any_support(rng, high=0.2)
    parts, space = carcass(width, depth, lift, low, board)
    parts += support(rng, width, depth, lift, kind)
    if kind == "stand":
        parts += drawers(rng, space, style, 2)
    else:
        parts += drawers(rng, space, style, whole(rng, 2, 4), graded=True)
    rise, shelf = between(rng, 0.25, 0.38), depth * between(rng, 0.56, 0.66)
    # The sides of the writing part: seen from the side, a rectangle whose front upper corner is cut off.
    side = np.array(
        [(-depth / 2, 0.0), (depth / 2, 0.0), (depth / 2, 0.03), (-depth / 2 + shelf, rise), (-depth / 2, rise)]
    )
    for x in (-(width - board) / 2, (width - board) / 2):
        # A plate in the (z, y) plane: drawn in xz, then stood up and turned.
        plate = slab(side, -board / 2, board, "side").rotated("x", -90.0).rotated("y", -90.0)
        parts.append(plate.moved((x, low - 0.001, 0)))
    parts.append(box((width, board, shelf), (0, low + rise - board / 2, -depth / 2 + shelf / 2), "top"))
    parts.append(box((width - board, rise, 0.01), (0, low + rise / 2, -depth / 2 + 0.005), "back"))
    run = depth - shelf
    length, angle = float(np.hypot(run, rise - 0.03)), float(np.degrees(np.arctan2(run, rise - 0.03)))
    leaf = Opening(-width / 2 + board, width / 2 - board, 0.0, length, 0.0, 0.0, 0.002)
    flat = replace(style, inset=False, gap=0.004, panel="flat")
    flap = [part.rotated("x", -angle).moved((0, low + 0.03, depth / 2 - 0.012)) for part in drawer(leaf, flat)]
    parts += [part.relabelled("flap") if part.label == "drawer" else part for part in flap]
    if happens(rng, 0.5):
        top = low + rise
        tall = between(rng, 0.5, 1.0)
        upper, room = carcass(width, shelf, top, top + tall, board, rear=-depth / 2)
        parts += upper + fill(rng, room, style, ("doors", "glass", "shelves"))
        parts += [part.moved((0, 0, -depth / 2 + shelf / 2)) for part in crown(rng, width, shelf, top + tall)]
    return parts


def apothecary_chest(rng: np.random.Generator) -> list[Part]:
    """Build many small drawers over doors, a shelf or longer drawers."""
    width, depth, height = between(rng, 0.6, 1.3), between(rng, 0.3, 0.42), between(rng, 0.8, 1.2)
    board = 0.018
    style = replace(any_front_style(rng), panel="flat", handle=pick(rng, ("knob", "square_knob", "none")))
    kind, lift = any_support(rng, high=0.2)
    parts, space = carcass(width, depth, lift, height, board)
    parts += support(rng, width, depth, lift, kind) + crown(rng, width, depth, height, 0.6)
    low, high = space.rows([(part := between(rng, 0.3, 0.5)), 1 - part])
    columns = whole(rng, 3, 4)
    parts += [shelf_board(high, high.bottom), *drawers(rng, high, style, whole(rng, 2, 3), columns)]
    return parts + fill(rng, low, style, ("doors", "drawers", "shelves"))
