"""Storage that shows what it holds: glass cabinets, hutches, corner cabinets, media walls."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from kpred.synthetic.cabinet.bodies import any_support, carcass, crown, divided, fill, support
from kpred.synthetic.cabinet.fronts import Opening, any_front_style, drawers, shelf_board, upright_board
from kpred.synthetic.chance import between, happens, pick, whole
from kpred.synthetic.parts import Part, beam, box, cylinder, ellipse, slab


def glass_cabinet(rng: np.random.Generator) -> list[Part]:
    """Build a show case: framed glass doors over the whole height or above a base, sometimes glass sides."""
    width, depth, height = between(rng, 0.4, 1.4), between(rng, 0.3, 0.5), between(rng, 1.0, 2.1)
    style = replace(any_front_style(rng), handle=pick(rng, ("knob", "bar", "square_knob")))
    kind, lift = any_support(rng, high=0.25)
    board = between(rng, 0.018, 0.03)
    parts = support(rng, width, depth, lift, kind) + crown(rng, width, depth, height, 0.4)
    if happens(rng, 0.35):
        post = between(rng, 0.02, 0.035)
        space = Opening(
            -(width - post) / 2, (width - post) / 2, lift + post / 2, height - post / 2, -depth / 2, depth / 2, post
        )
        x, z, tall, middle = space.right, (depth - post) / 2, height - lift, (height + lift) / 2
        parts += [box((post, tall, post), (sx * x, middle, sz * z), "post") for sx in (-1, 1) for sz in (-1, 1)]
        parts += [
            box((width, post, depth), (0, y, 0), "top" if y > middle else "bottom") for y in (space.bottom, space.top)
        ]
        parts += [box((0.006, tall, depth - post), (side * x, middle, 0), "glass") for side in (-1, 1)]
        parts.append(box((width - post, tall, 0.006), (0, middle, -z), pick(rng, ("glass", "back"))))
        return parts + fill(rng, space, style, ("glass",))
    case, space = carcass(width, depth, lift, height, board)
    parts += case
    if happens(rng, 0.5):
        low, space = space.rows([(part := between(rng, 0.15, 0.4)), 1 - part])
        parts.append(shelf_board(space, space.bottom))
        parts += fill(rng, low, style, ("doors", "drawers"))
    boards, cells = divided(rng, space, max(1, round(width / 0.9)))
    for cell in cells:
        parts += fill(rng, cell, style, ("glass",))
    return parts + boards


def hutch(rng: np.random.Generator) -> list[Part]:
    """Build a china cabinet: a deep base with doors and drawers, a shallow upper case, sometimes a gap between them."""
    width, depth, low = between(rng, 0.8, 1.7), between(rng, 0.4, 0.58), between(rng, 0.72, 0.95)
    height, shallow, board = between(rng, 1.7, 2.2), depth * between(rng, 0.58, 0.75), between(rng, 0.018, 0.026)
    style = any_front_style(rng)
    kind, lift = any_support(rng, high=0.12)
    parts, space = carcass(width, depth, lift, low, board)
    parts += support(rng, width, depth, lift, kind)
    parts.append(box((width + 0.03, 0.025, depth + 0.02), (0, low + 0.0115, 0.01), "worktop"))
    boards, cells = divided(rng, space, max(1, round(width / between(rng, 0.5, 0.8))))
    form = pick(rng, ("mixed", "doors", "drawers"))
    for cell in cells:
        parts += fill(rng, cell, style, (form, "mixed"), (4, 1))
    base, narrow = low + 0.02, width - pick(rng, (0.0, 0.0, 0.06))
    upper, room = carcass(narrow, shallow, base, height, board, rear=-depth / 2)
    parts += boards + upper
    parts += [part.moved((0, 0, (shallow - depth) / 2)) for part in crown(rng, narrow, shallow, height, 0.7)]
    if happens(rng, 0.4):
        gap, room = room.rows([(part := between(rng, 0.2, 0.35)), 1 - part])
        parts.append(shelf_board(room, room.bottom))
    boards, cells = divided(rng, room, max(1, round(narrow / between(rng, 0.45, 0.9))))
    filling = pick(rng, ("glass", "shelves", "doors"), (3, 3, 1))
    for index, cell in enumerate(cells):
        centre = len(cells) == 3 and index == 1
        parts += fill(rng, cell, style, ("shelves",) if centre else (filling,))
    return parts + boards


def corner_cabinet(rng: np.random.Generator) -> list[Part]:
    """Build a cabinet for a room's corner: a triangular or five-sided plan, its long front at +z."""
    leg, height, board = between(rng, 0.45, 0.8), between(rng, 0.7, 2.1), 0.02
    wing = pick(rng, (0.0, between(rng, 0.1, 0.25) * leg))
    # The corner points to -z; both walls run at 45 degrees from it.
    half = leg / np.sqrt(2)
    cut = wing / np.sqrt(2)
    outline = np.array([(0.0, -half), (half, 0.0), (half - cut, cut), (cut - half, cut), (-half, 0.0)])
    if wing == 0:
        outline = np.array([(0.0, -half), (half, 0.0), (-half, 0.0)])
    front, z = 2 * (half - cut), cut
    lift, count = pick(rng, (0.0, 0.07)), max(1, round(height / between(rng, 0.32, 0.45)) - 1)
    parts = [slab(outline * 0.94, 0.0, lift + 0.002, "plinth")] if lift else []
    levels = np.linspace(lift, height - board, count + 2)
    for index, y in enumerate(levels):
        parts.append(
            slab(outline, float(y), board, "bottom" if index == 0 else "top" if index == count + 1 else "shelf")
        )
    tall, middle = height - lift, (height + lift) / 2
    for side in (-1, 1):
        parts.append(beam((0, middle, -half + board), (side * half, middle, 0.0), board, tall, "side"))
        if wing:
            parts.append(beam((side * half, middle, 0.0), (side * (half - cut), middle, z), board, tall, "side"))
    wide = front * 0.48
    space = Opening(-wide, wide, lift + board / 2, height - board / 2, z - 0.02, z, board)
    style = replace(any_front_style(rng), inset=False)
    form = pick(rng, ("open", "doors", "glass", "half"))
    count = 1 if front < 0.6 else 2
    if form == "half":
        low, _ = space.rows([(part := float(levels[1 + len(levels) // 3] - lift) / tall), 1 - part])
        parts += fill(rng, low, style, ("doors",))
    elif form != "open":
        parts += [part for part in fill(rng, space, style, (form,)) if part.label != "shelf"]
    return parts


def tv_wall(rng: np.random.Generator) -> list[Part]:
    """Build a media wall: a low bench between two towers, sometimes bridged above."""
    bench, tower, depth = between(rng, 0.9, 1.4), between(rng, 0.3, 0.5), between(rng, 0.35, 0.45)
    low, height, board = between(rng, 0.35, 0.55), between(rng, 1.2, 2.1), between(rng, 0.018, 0.026)
    style, deep = any_front_style(rng), depth * between(rng, 0.75, 1.0)
    parts, space = carcass(bench, depth, 0.0, low, board)
    boards, cells = divided(rng, space, whole(rng, 2, 3))
    parts += boards
    for cell in cells:
        parts += fill(rng, cell, style, ("drawers", "doors", "shelves", "open"))
    towers, room = carcass(tower, deep, 0.0, height, board, rear=-depth / 2)
    below, above = room.rows([(part := between(rng, 0.25, 0.5)), 1 - part])
    towers += [shelf_board(above, above.bottom), *fill(rng, below, style, ("doors", "drawers"))]
    towers += fill(rng, above, style, ("shelves", "glass", "doors"))
    shift = (bench + tower) / 2 - 0.002
    sides = (-1, 1) if happens(rng, 0.7) else (1,)
    for side in sides:
        moved = [part.moved((shift, 0, 0)) for part in towers]
        parts += moved if side > 0 else [part.mirrored_x() for part in moved]
    if len(sides) == 2 and happens(rng, 0.6):
        parts.append(box((bench + 0.01, board, deep * 0.8), (0, height - board / 2, -depth / 2 + deep * 0.4), "bridge"))
        if happens(rng, 0.5):
            parts.append(box((bench + 0.01, board, deep * 0.7), (0, height - 0.3, -depth / 2 + deep * 0.35), "bridge"))
    if happens(rng, 0.4):
        parts.append(box((bench, height - low - board, 0.012), (0, (height + low) / 2, -depth / 2 + 0.006), "back"))
    return [part.mirrored_x() for part in parts] if happens(rng, 0.5) else parts


def round_shelf(rng: np.random.Generator) -> list[Part]:
    """Build a half-round or quarter-round shelf: flat back, bowed boards to +z, posts or a middle panel."""
    width, height = between(rng, 0.4, 1.0), between(rng, 0.7, 1.9)
    depth, board, count = width * between(rng, 0.4, 0.55), between(rng, 0.015, 0.03), whole(rng, 3, 6)
    arc = ellipse(width, 2 * depth, 32)[:17]
    parts = [slab(arc, float(y), board, "shelf") for y in np.linspace(pick(rng, (0.0, 0.06)), height - board, count)]
    parts.append(box((width * pick(rng, (1.0, 0.6)), height, board), (0, height / 2, board / 2), "back"))
    if happens(rng, 0.5):
        parts.append(box((board, height, depth * 0.9), (0, height / 2, depth * 0.45), "divider"))
    else:
        for angle in np.radians(pick(rng, ((55, 125), (90,), (40, 90, 140)))):
            x, z = 0.46 * width * np.cos(angle), 0.92 * depth * np.sin(angle)
            parts.append(cylinder(0.014, (x, 0, z), (x, height, z), "post", 10))
    return parts


def display_steps(rng: np.random.Generator) -> list[Part]:
    """Build a narrow bookcase of stacked boxes whose bays shift to the left and right from row to row."""
    rows, wide, tall = whole(rng, 3, 6), between(rng, 0.4, 0.8), between(rng, 0.26, 0.38)
    depth, board = between(rng, 0.22, 0.36), between(rng, 0.018, 0.03)
    shift, back, solid = wide * between(rng, 0.08, 0.35), happens(rng, 0.4), happens(rng, 0.4)
    style = replace(any_front_style(rng), inset=True)
    parts: list[Part] = []
    for k in range(rows):
        offset = shift / 2 * (-1) ** k
        level, _ = carcass(wide, depth, k * (tall - board), k * (tall - board) + tall, board, back)
        space = Opening(
            -(wide - board) / 2,
            (wide - board) / 2,
            k * (tall - board) + board / 2,
            k * (tall - board) + tall - board / 2,
            -depth / 2,
            depth / 2,
            board,
        )
        if solid and happens(rng, 0.3):
            level += drawers(rng, space, style, 1)
        elif happens(rng, 0.3):
            level.append(upright_board(space, space.middle[0]))
        parts += [part.moved((offset, 0, 0)) for part in level]
    return parts
