"""Closed storage: wardrobes, chests of drawers, sideboards, kitchen units, nightstands and their kin."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from kpred.shapes.synthetic.cabinet_bodies import any_support, carcass, crown, divided, fill, lifted, support
from kpred.shapes.synthetic.cabinet_fronts import (
    FrontStyle,
    Opening,
    any_front_style,
    door,
    doors,
    drawer,
    drawers,
    shelf_board,
    upright_board,
)
from kpred.shapes.synthetic.chance import between, happens, pick, shares, whole
from kpred.shapes.synthetic.parts import Part, box, cylinder, frustum, slab


def _board(rng: np.random.Generator) -> float:
    return between(rng, 0.015, 0.03)


def wardrobe(rng: np.random.Generator) -> list[Part]:
    """One to four hinged doors over the whole height, or over drawers."""
    count = pick(rng, (1, 2, 2, 3, 4))
    width, depth = between(rng, 0.38, 0.56) * count, between(rng, 0.48, 0.66)
    height, board, style = between(rng, 1.6, 2.3), _board(rng), any_front_style(rng)
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
    """Two or three wide doors in two tracks, one behind the other."""
    width, depth, height = between(rng, 1.2, 2.4), between(rng, 0.55, 0.7), between(rng, 1.9, 2.3)
    board, count = _board(rng), whole(rng, 2, 3)
    style = replace(any_front_style(rng), inset=True, handle=pick(rng, ("none", "bar", "edge")), thickness=0.02)
    lift = pick(rng, (0.0, 0.06))
    parts, space = carcass(width, depth, lift, height, board)
    parts += support(rng, width, depth, lift, "plinth") + crown(rng, width, depth, height, 0.3)
    edge = 0.5 * board
    for index, cell in enumerate(space.columns([1 / count] * count)):
        leaf = replace(cell, left=cell.left - edge * (index > 0), right=cell.right + edge * (index < count - 1),
                       front=cell.front - 0.024 * (index % 2))  # fmt: skip
        parts += door(leaf, style, -1 if index else 1)
    return parts


def chest_of_drawers(rng: np.random.Generator) -> list[Part]:
    """n x m drawers, alike, graded, or with small ones in the top row; low and wide to high and narrow."""
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
    """Columns of doors, drawers and open bays in a low case on legs or a plinth."""
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
    """Low and wide: open bays in the middle or above, drawers or doors beside or below."""
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
        parts += drawers(rng, low, style, 1, whole(rng, 1, 3)) if happens(rng, 0.6) else doors(low, style, whole(rng, 2, 4))
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
    """One to four units under a worktop with a recessed toe kick; drawers above doors in most."""
    count = whole(rng, 1, 4)
    width, depth, height = between(rng, 0.4, 0.6) * count, between(rng, 0.55, 0.63), between(rng, 0.82, 0.92)
    worktop, kick, style = between(rng, 0.025, 0.045), between(rng, 0.08, 0.15), any_front_style(rng)
    case = height - worktop
    parts, space = carcass(width, depth, kick, case, 0.018)
    parts.append(box((width, kick, depth - 0.06), (0, kick / 2, -0.03), "plinth"))
    parts.append(box((width + pick(rng, (0.0, 0.03)), worktop, depth + 0.03), (0, case + worktop / 2, 0.015), "worktop"))
    boards, cells = divided(rng, space, count)
    parts += boards
    for cell in cells:
        parts += fill(rng, cell, style, ("mixed", "doors", "drawers"), (3, 1.5, 1.5))
    if happens(rng, 0.3):
        tall = between(rng, 0.06, 0.4)
        parts.append(box((width, tall, 0.015), (0, height + tall / 2 - 0.001, -depth / 2 + 0.0075), "splash"))
    return parts


def wall_cabinet(rng: np.random.Generator) -> list[Part]:
    """A shallow hung cabinet with hinged doors, a lift-up flap, or glass, and an open shelf at times."""
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
    """Narrow and high: doors, drawers and open parts one over the other."""
    width, depth, height = between(rng, 0.3, 0.6), between(rng, 0.28, 0.6), between(rng, 1.3, 2.3)
    board, style = _board(rng), any_front_style(rng)
    kind, lift = any_support(rng, high=0.16)
    parts, space = carcass(width, depth, lift, height, board)
    parts += support(rng, width, depth, lift, kind) + crown(rng, width, depth, height, 0.4)
    rows = space.rows(shares(rng, whole(rng, 2, 4), 0.5))
    parts += [shelf_board(row, row.bottom) for row in rows[1:]]
    for index, row in enumerate(rows):
        parts += fill(rng, row, style, ("doors", "shelves", "drawers", "glass"), (3, 1.5, 1.5 if index < 2 else 0.0, 1))
    return parts


def filing_cabinet(rng: np.random.Generator) -> list[Part]:
    """Two to five equal high drawers in one or two columns, metal-thin sides, a label holder over each handle."""
    rows, columns = whole(rng, 2, 5), pick(rng, (1, 1, 1, 2))
    width, depth, height = between(rng, 0.38, 0.5) * columns, between(rng, 0.45, 0.7), between(rng, 0.27, 0.34) * rows + 0.05
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
            for x in (-width * 0.4, width * 0.4) for z in (-depth * 0.4, depth * 0.4)
        ]  # fmt: skip
        return lifted(parts, 0.048) + wheels
    return parts


def nightstand(rng: np.random.Generator) -> list[Part]:
    """A small case with one to three drawers, a door, or a drawer over an open bay."""
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


def cornice_cabinet(rng: np.random.Generator) -> list[Part]:
    """A classical cupboard: plinth, framed doors, corner pilasters, a large cornice."""
    width, depth, height = between(rng, 0.8, 1.6), between(rng, 0.4, 0.6), between(rng, 1.0, 2.2)
    style = replace(any_front_style(rng), panel=pick(rng, ("framed", "raised")), inset=False)
    base, tall, out = between(rng, 0.08, 0.16), between(rng, 0.06, 0.14), between(rng, 0.04, 0.09)
    parts, space = carcass(width, depth, base, height - tall, 0.025)
    parts.append(box((width + 0.04, base, depth + 0.03), (0, base / 2, 0.01), "plinth"))
    parts.append(
        frustum((width + 0.02, depth + 0.02), (width + 2 * out, depth + out), (0, height - tall - 0.001, 0), (0, height, out / 2), "cornice")
    )  # fmt: skip
    wide = between(rng, 0.04, 0.08)
    for side in (-1, 1):
        x = side * (width - wide) / 2
        parts.append(box((wide, height - tall - base, 0.02), (x, (height - tall + base) / 2, depth / 2 + 0.009), "pilaster"))
    inner = replace(space, left=space.left + wide - 0.012, right=space.right - wide + 0.012)
    if happens(rng, 0.5):
        low, high = inner.rows([(part := between(rng, 0.15, 0.35)), 1 - part])
        parts += [shelf_board(high, high.bottom), *drawers(rng, low, style, 1, pick(rng, (1, 2)))]
        return parts + fill(rng, high, style, ("doors", "glass"), (3, 1))
    return parts + doors(inner, style, 2 if width < 1.3 else pick(rng, (2, 3)))


def shoe_cabinet(rng: np.random.Generator) -> list[Part]:
    """Shallow, with tip-out fronts that stand slanted in their openings."""
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


def secretary(rng: np.random.Generator) -> list[Part]:
    """Drawers below, a slanted writing flap above them, a bookcase or doors on top at times."""
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
    side = np.array([(-depth / 2, 0.0), (depth / 2, 0.0), (depth / 2, 0.03), (-depth / 2 + shelf, rise), (-depth / 2, rise)])
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


def locker(rng: np.random.Generator) -> list[Part]:
    """Columns of narrow doors, one to four in each column, with vents."""
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
                parts.append(box((row.width * 0.5, 0.008, 0.006), (row.middle[0], row.top - 0.07 - 0.03 * k, face), "vent"))
    return parts


def apothecary_chest(rng: np.random.Generator) -> list[Part]:
    """Many small drawers over doors, a shelf or longer drawers."""
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

