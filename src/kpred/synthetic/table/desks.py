"""Desks: drawers and knee hole look to +z, where the person sits."""

from __future__ import annotations

import numpy as np

from kpred.synthetic.cabinet.fronts import (
    FrontStyle,
    Opening,
    any_front_style,
    doors,
    drawers,
    shelf_board,
    upright_board,
)
from kpred.synthetic.chance import between, happens, pick, whole
from kpred.synthetic.parts import Part, beam, box, slab
from kpred.synthetic.table.legs import LegStyle, any_leg_style, four_legs, leg_set
from kpred.synthetic.table.tops import tabletop


def _pedestal(
    rng: np.random.Generator, style: FrontStyle, left: float, right: float, head: float, depth: float, board: float
) -> list[Part]:
    """Build a desk's drawer case from `left` to `right` (outer faces), its front at depth / 2."""
    lift = pick(rng, (0.0, 0.0, 0.05))
    middle, width = (left + right) / 2, right - left
    parts = [
        box((board, head, depth), (left + board / 2, head / 2, 0), "side"),
        box((board, head, depth), (right - board / 2, head / 2, 0), "side"),
        box((width - 2 * board, head, 0.01), (middle, head / 2, -depth / 2 + 0.005), "back"),
        box((width - 2 * board, board, depth), (middle, lift + board / 2, 0), "bottom"),
    ]
    if lift:
        parts.append(box((width - 2 * board, lift, 0.015), (middle, lift / 2, depth / 2 - 0.04), "plinth"))
    front = Opening(left + board / 2, right - board / 2, lift + board / 2, head, -depth / 2, depth / 2, board)
    kind = pick(rng, ("drawers", "drawers", "file", "door", "open"))
    if kind == "drawers":
        return parts + drawers(rng, front, style, whole(rng, 2, 4), graded=happens(rng, 0.4))
    if kind == "file":
        low, high = front.rows([0.6, 0.4])
        return (
            parts
            + drawers(rng, low, style, 1)
            + [shelf_board(high, high.bottom)]
            + drawers(rng, high, style, whole(rng, 1, 2))
        )
    if kind == "door":
        low, high = front.rows([0.75, 0.25])
        return parts + doors(low, style, 1) + [shelf_board(high, high.bottom)] + drawers(rng, high, style, 1)
    low, high = front.rows([0.65, 0.35])
    return parts + [shelf_board(low, low.middle[1]), shelf_board(high, high.bottom)] + drawers(rng, high, style, 1)


def _knee_drawer(
    rng: np.random.Generator, style: FrontStyle, left: float, right: float, head: float, depth: float
) -> list[Part]:
    tall = between(rng, 0.08, 0.13)
    front = Opening(left, right, head - tall, head, -depth * 0.4, depth / 2, 0.016)
    return [shelf_board(front, front.bottom, "rail"), *drawers(rng, front, style, 1, 2 if right - left > 0.9 else 1)]


def pedestal_desk(rng: np.random.Generator) -> list[Part]:
    """Build a desk with a drawer case at one or both sides, a panel or legs at the free side."""
    width, depth, height = between(rng, 1.0, 2.0), between(rng, 0.5, 0.95), between(rng, 0.7, 0.8)
    thick, board, style = between(rng, 0.02, 0.05), between(rng, 0.016, 0.03), any_front_style(rng)
    over = pick(rng, (0.0, 0.015, 0.04))
    wide, deep, head = width - 2 * over, depth - 2 * over, height - thick
    case = min(between(rng, 0.3, 0.48), wide * 0.36)
    parts = tabletop(rng, width, depth, height, thick, pick(rng, ("rectangle", "rectangle", "bevelled", "rounded")))
    left, right = -wide / 2, wide / 2
    parts += _pedestal(rng, style, left, left + case, head, deep, board)
    knee_left, knee_right = left + case - board / 2, right
    if happens(rng, 0.5):
        parts += _pedestal(rng, style, right - case, right, head, deep, board)
        knee_right = right - case + board / 2
    elif happens(rng, 0.6):
        parts.append(box((board, head, deep), (right - board / 2, head / 2, 0), "side"))
        knee_right = right - board / 2
    else:
        legs = any_leg_style(rng, height, ("square", "tapered", "round"))
        legs = LegStyle(legs.kind, min(legs.thickness, 0.06), legs.taper, 0.0, legs.waist)
        x, z = right - 0.05, deep / 2 - 0.05
        parts += leg_set(legs, [(x, -z), (x, z)], head)
    if happens(rng, 0.5):
        tall = head * between(rng, 0.35, 0.95)
        span = knee_right - knee_left
        parts.append(box((span, tall, 0.016), ((knee_left + knee_right) / 2, head - tall / 2, -deep * 0.35), "panel"))
    if happens(rng, 0.5):
        parts += _knee_drawer(rng, style, knee_left, knee_right, head, deep)
    return [part.mirrored_x() for part in parts] if happens(rng, 0.5) else parts


def writing_desk(rng: np.random.Generator) -> list[Part]:
    """Build a desk on legs with a row of drawers under its top, sometimes a low gallery on top."""
    width, depth, height = between(rng, 0.8, 1.7), between(rng, 0.45, 0.8), between(rng, 0.7, 0.8)
    thick, style = between(rng, 0.018, 0.04), any_front_style(rng)
    legs = any_leg_style(rng, height, ("square", "tapered", "turned", "cabriole", "round_tapered", "angle"))
    legs = LegStyle(legs.kind, min(legs.thickness, 0.07), legs.taper, legs.splay * 0.5, legs.waist)
    over, apron = between(rng, 0.0, 0.03), between(rng, 0.09, 0.16)
    wide, deep, head = width - 2 * over, depth - 2 * over, height - thick
    parts = tabletop(rng, width, depth, height, thick, pick(rng, ("rectangle", "bevelled", "rounded")))
    parts += four_legs(rng, wide, deep, head, legs, apron, stretched=happens(rng, 0.25))
    t = legs.thickness
    front = Opening(-wide / 2 + t, wide / 2 - t, head - apron, head, -deep / 2, deep / 2 - t / 2 + 0.012, 0.014)
    parts += drawers(rng, front, style, 1, whole(rng, 1, 4))
    if happens(rng, 0.3):
        side = pick(rng, (-1, 1))
        low = Opening(
            side * wide / 4 - wide / 4 + t,
            side * wide / 4 + wide / 4 - t,
            head - apron - between(rng, 0.12, 0.3),
            head - apron,
            -deep * 0.4,
            deep / 2 - t / 2 + 0.012,
            0.014,
        )
        x, y, z = low.middle
        parts.append(box((low.width, low.height, low.depth - 0.02), (x, y, z - 0.01), "case"))
        parts += drawers(rng, low, style, whole(rng, 1, 2))
    if happens(rng, 0.25):
        tall = between(rng, 0.08, 0.16)
        parts.append(box((width * 0.96, tall, 0.015), (0, height + tall / 2 - 0.001, -depth / 2 + 0.02), "gallery"))
        for end in (-1, 1):
            parts.append(
                box(
                    (0.015, tall, depth * 0.4),
                    (end * width * 0.475, height + tall / 2 - 0.001, -depth * 0.3 + 0.02),
                    "gallery",
                )
            )
    return parts


def hutch_desk(rng: np.random.Generator) -> list[Part]:
    """Build any of the plain desks with shelves or pigeon holes on the back of its top."""
    width, depth, height, board = (
        between(rng, 0.9, 1.6),
        between(rng, 0.5, 0.75),
        between(rng, 0.72, 0.78),
        between(rng, 0.016, 0.025),
    )
    style, head = any_front_style(rng), height - board
    parts = [box((width, board, depth), (0, height - board / 2, 0), "top")]
    case = between(rng, 0.28, 0.42)
    if happens(rng, 0.6):
        parts += _pedestal(rng, style, -width / 2, -width / 2 + case, head, depth, board)
    else:
        parts.append(box((board, head, depth), (-(width - board) / 2, head / 2, 0), "side"))
    parts.append(box((board, head, depth), ((width - board) / 2, head / 2, 0), "side"))
    tall = head * between(rng, 0.4, 0.9)
    parts.append(box((width - board, tall, 0.012), (0, head - tall / 2, -depth * 0.42), "panel"))
    rise, deep = between(rng, 0.25, 0.8), between(rng, 0.18, 0.32)
    rear = -depth / 2
    space = Opening(-(width - board) / 2, (width - board) / 2, height, height + rise, rear, rear + deep, board)
    parts += [upright_board(space, x, "side") for x in (space.left, space.right)]
    parts.append(box((width, board, deep), (0, space.top, rear + deep / 2), "top_shelf"))
    if happens(rng, 0.6):
        parts.append(box((width, rise, 0.01), (0, height + rise / 2, rear + 0.005), "back"))
    count = whole(rng, 1, 3)
    cells = space.columns([1 / count] * count)
    parts += [upright_board(cell, cell.left) for cell in cells[1:]]
    for cell in cells:
        inner = whole(rng, 0, 2) if rise > 0.4 else whole(rng, 0, 1)
        rows = cell.rows([1 / (inner + 1)] * (inner + 1))
        parts += [shelf_board(row, row.bottom) for row in rows[1:]]
        if happens(rng, 0.2):
            parts += doors(rows[-1], style, 1 if cell.width < 0.6 else 2)
    return [part.mirrored_x() for part in parts] if happens(rng, 0.5) else parts


def l_desk(rng: np.random.Generator) -> list[Part]:
    """Build a desk with a return at one side; its knee space opens to the inner corner."""
    width = between(rng, 1.3, 2.2)
    length = width * between(rng, 0.65, 1.0)
    depth, arm = between(rng, 0.55, 0.8), between(rng, 0.42, 0.65)
    height, thick, board = between(rng, 0.7, 0.78), between(rng, 0.02, 0.04), 0.022
    head = height - thick
    rear = -depth / 2
    fillet = pick(rng, (0.0, between(rng, 0.1, 0.3)))
    inner = [(width / 2 - arm, rear + depth)]
    if fillet:
        inner = [(width / 2 - arm, rear + depth + fillet), (width / 2 - arm - fillet, rear + depth)]
    outline = np.array(
        [
            (-width / 2, rear),
            (width / 2, rear),
            (width / 2, rear + length),
            (width / 2 - arm, rear + length),
            *inner,
            (-width / 2, rear + depth),
        ]
    )
    parts = [slab(outline, head, thick, "top")]
    form = pick(rng, ("panels", "legs", "mixed"))
    if form == "legs":
        legs = LegStyle(pick(rng, ("square", "round", "tapered")), between(rng, 0.04, 0.06), 0.6, 0.0, 0.6)
        e = 0.05
        spots = [
            (-width / 2 + e, rear + e),
            (-width / 2 + e, rear + depth - e),
            (width / 2 - e, rear + e),
            (width / 2 - e, rear + length - e),
            (width / 2 - arm + e, rear + length - e),
        ]
        parts += leg_set(legs, spots, head)
        parts.append(box((width - 2 * e, 0.06, 0.02), (0, head - 0.03, rear + e), "apron"))
    else:
        parts.append(box((board, head, depth * 0.96), (-(width - board) / 2, head / 2, rear + depth * 0.48), "side"))
        parts.append(box((arm * 0.96, head, board), (width / 2 - arm * 0.48, head / 2, rear + length - board), "side"))
        parts.append(box((board, head, board * 2), (width / 2 - board / 2, head / 2, rear + board), "leg"))
        tall = head * between(rng, 0.4, 1.0)
        parts.append(box((width - board, tall, 0.016), (0, head - tall / 2, rear + 0.03), "panel"))
        parts.append(
            box((0.016, tall, length - board), (width / 2 - 0.02, head - tall / 2, rear + length / 2), "panel")
        )
    if form != "legs" or happens(rng, 0.5):
        style, case = any_front_style(rng), between(rng, 0.32, 0.42)
        drawer_case = _pedestal(rng, style, -width / 2 + board, -width / 2 + board + case, head, depth * 0.94, board)
        parts += [part.moved((0, 0, rear + depth * 0.5)) for part in drawer_case]
    return [part.mirrored_x() for part in parts] if happens(rng, 0.5) else parts


def panel_desk(rng: np.random.Generator) -> list[Part]:
    """Build panel ends, a back panel, and one of: nothing, a keyboard tray, a shelf, a raised monitor board."""
    width, depth, height = between(rng, 0.8, 1.8), between(rng, 0.45, 0.8), between(rng, 0.7, 0.78)
    board = between(rng, 0.016, 0.035)
    head, inset = height - board, pick(rng, (0.0, 0.02, 0.1))
    parts = [box((width, board, depth), (0, height - board / 2, 0), "top")]
    span = width - 2 * inset - board
    for side in (-1, 1):
        parts.append(box((board, head, depth * (1.0 if inset == 0 else 0.92)), (side * span / 2, head / 2, 0), "side"))
    tall = head * between(rng, 0.3, 1.0)
    parts.append(box((span, tall, 0.016), (0, head - tall / 2, -depth * between(rng, 0.15, 0.45)), "panel"))
    if happens(rng, 0.4):
        parts.append(box((span, 0.016, depth * 0.5), (0, head - 0.12, depth * 0.18), "tray"))
    if happens(rng, 0.35):
        x = span * between(rng, -0.2, 0.25)
        parts.append(box((board, head, depth * 0.85), (x, head / 2, 0), "divider"))
        for y in (head * 0.35, head * 0.68):
            parts.append(box((span / 2 - x, 0.016, depth * 0.8), ((span / 2 + x) / 2, y, 0), "shelf"))
    if happens(rng, 0.35):
        rise, deep = between(rng, 0.1, 0.3), depth * between(rng, 0.3, 0.45)
        z = -depth / 2 + deep / 2
        wide = width * pick(rng, (1.0, 0.55))
        parts.append(box((wide, 0.018, deep), (0, height + rise, z), "top_shelf"))
        parts += [
            box((0.018, rise, deep), (side * (wide / 2 - 0.009), height + rise / 2, z), "side") for side in (-1, 1)
        ]
    return parts


def open_bay_desk(rng: np.random.Generator) -> list[Part]:
    """Build a top on a shelf case at one side (bays open to +z) and legs or trestles at the other."""
    width, depth, height, thick = (
        between(rng, 1.1, 1.8),
        between(rng, 0.5, 0.75),
        between(rng, 0.71, 0.78),
        between(rng, 0.02, 0.045),
    )
    head, board, case = height - thick, 0.018, between(rng, 0.3, 0.45)
    left = -width / 2
    front = Opening(left + board / 2, left + case - board / 2, board / 2, head, -depth / 2, depth / 2, board)
    parts = [box((width, thick, depth), (0, height - thick / 2, 0), "top")]
    parts += [
        upright_board(front, front.left, "side"),
        upright_board(front, front.right, "side"),
        shelf_board(front, front.bottom, "bottom"),
    ]
    rows = front.rows([1 / 3] * 3) if happens(rng, 0.6) else front.rows([0.5, 0.5])
    parts += [shelf_board(row, row.bottom) for row in rows[1:]]
    if happens(rng, 0.4):
        parts += drawers(rng, rows[-1], any_front_style(rng), 1)
    x, z = width / 2 - 0.06, depth / 2 - 0.05
    if happens(rng, 0.5):
        parts += leg_set(
            LegStyle(pick(rng, ("square", "round", "hairpin")), 0.045, 0.7, 0.0, 0.7), [(x, z), (x, -z)], head
        )
    else:
        parts += [beam((x, 0, s * z), (x, head, s * z * 0.25), 0.035, 0.045, "leg") for s in (-1, 1)]
        parts.append(box((0.03, 0.04, z * 1.4), (x, head * 0.3, 0), "support"))
    return [part.mirrored_x() for part in parts] if happens(rng, 0.5) else parts
