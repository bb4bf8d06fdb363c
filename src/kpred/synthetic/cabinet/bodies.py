"""The bodies of cabinets: boards round a space, with what carries them and what crowns them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from kpred.synthetic.cabinet.fronts import (
    FrontStyle,
    Opening,
    doors,
    drawers,
    shelf_board,
    shelves,
    upright_board,
)
from kpred.synthetic.chance import between, fractions, happens, pick, whole
from kpred.synthetic.parts import Part, box, frustum
from kpred.synthetic.table.legs import LegStyle, any_leg_style, corners, leg_set, rails


def carcass(
    width: float, depth: float, bottom: float, top: float, board: float, back: bool = True, rear: float | None = None
) -> tuple[list[Part], Opening]:
    """Build sides, bottom, top and back of a case, and the space inside, open to +z.

    `width` and `depth` are outer measures, `bottom` and `top` the heights of the outer faces; the case's rear is at
    `rear`, or -depth / 2.
    """
    behind = -depth / 2 if rear is None else rear
    space = Opening(
        -(width - board) / 2, (width - board) / 2, bottom + board / 2, top - board / 2, behind, behind + depth, board
    )
    tall, middle, z = top - bottom, (top + bottom) / 2, behind + depth / 2
    parts = [box((board, tall, depth), (x, middle, z), "side") for x in (space.left, space.right)]
    parts.append(box((width - 2 * board, board, depth), (0, space.bottom, z), "bottom"))
    parts.append(box((width - 2 * board, board, depth), (0, space.top, z), "top"))
    if back:
        thin = 0.008
        parts.append(box((width - board, tall - board, thin), (0, middle, behind + thin / 2), "back"))
    return parts, space


def support(rng: np.random.Generator, width: float, depth: float, height: float, kind: str) -> list[Part]:
    """Build the support of a case, `height` high: "plinth", "skirt", "legs", "sled", "feet" or "stand"."""
    if height <= 0.001:
        return []
    if kind == "plinth":
        return [box((width, height, depth * 0.92), (0, height / 2, -depth * 0.04), "plinth")]
    if kind == "skirt":
        parts = [box((width * 0.16, height, depth), (side * width * 0.42, height / 2, 0), "foot") for side in (-1, 1)]
        return parts + [box((width, height * 0.5, 0.02), (0, height * 0.75, depth / 2 - 0.02), "skirt")]
    if kind == "sled":
        bar, wide = 0.025, width * between(rng, 0.75, 0.95)
        parts = []
        for side in (-1, 1):
            x = side * (wide - bar) / 2
            parts.append(box((bar, bar, depth * 0.85), (x, bar / 2, 0), "runner"))
            parts += [box((bar, height, bar), (x, height / 2, z * depth * 0.4), "leg") for z in (-1, 1)]
        return parts
    if kind == "feet":
        size = min(0.09, depth * 0.25)
        return [
            frustum((size * 0.7, size * 0.7), (size, size), (x, 0, z), (x, height, z), "foot")
            for x, z in corners(width - 1.2 * size, depth - 1.2 * size)
        ]
    if kind == "stand":
        style = LegStyle("square", between(rng, 0.025, 0.045), 1.0, 0.0, 1.0)
        w, d = width - style.thickness, depth - style.thickness
        parts = leg_set(style, corners(w, d), height)
        parts += rails(w, d, height - 0.015, 0.03, style.thickness * 0.9, "frame")
        if happens(rng, 0.4):
            parts += rails(w, d, 0.06, 0.025, style.thickness * 0.8, "frame")
        return parts
    style = any_leg_style(rng, height, ("tapered", "square", "round_tapered", "turned", "cabriole", "round"))
    style = LegStyle(style.kind, between(rng, 0.03, 0.055), style.taper, min(style.splay, 0.2 * height), style.waist)
    inset = style.thickness + between(rng, 0.0, 0.05)
    parts = leg_set(style, corners(width - inset, depth - inset), height + 0.002)
    if width > 1.5 and happens(rng, 0.6):
        parts += leg_set(style, [(0.0, depth * 0.3), (0.0, -depth * 0.3)], height + 0.002)
    return parts


def any_support(rng: np.random.Generator, low: float = 0.0, high: float = 0.25) -> tuple[str, float]:
    """Draw a kind for `support` and its height between `low` and `high`; sometimes none."""
    kind = pick(rng, ("plinth", "skirt", "legs", "feet", "sled", "stand", "none"), (4, 1.5, 3, 1.5, 1, 1, 2))
    if kind == "none":
        return kind, 0.0
    if kind in ("plinth", "skirt", "feet"):
        return kind, between(rng, 0.03, min(0.11, high))
    return kind, between(rng, max(low, 0.09), max(high, 0.12))


def crown(rng: np.random.Generator, width: float, depth: float, top: float, chance: float = 0.5) -> list[Part]:
    """Build a cover plate or cornice on a case's top, or nothing with the probability 1 - `chance`."""
    if not happens(rng, chance):
        return []
    over = between(rng, 0.0, 0.03)
    thick = between(rng, 0.015, 0.045)
    kind = pick(rng, ("plate", "plate", "cornice", "bevel"))
    z = over / 2
    plate = box((width + 2 * over, thick, depth + over), (0, top + thick / 2 - 0.001, z), "top")
    if kind == "plate":
        return [plate]
    tall, out = between(rng, 0.03, 0.08), between(rng, 0.02, 0.06)
    low, high = (width + 0.01, depth), (width + 2 * out, depth + out)
    moulding = frustum(low, high, (0, top - 0.002, 0), (0, top + tall, out / 2), "cornice")
    if kind == "bevel":
        return [moulding]
    lid = box((width + 2 * out + 0.01, 0.015, depth + out + 0.005), (0, top + tall + 0.0065, out / 2), "top")
    return [moulding, lid]


def fill(
    rng: np.random.Generator,
    cell: Opening,
    style: FrontStyle,
    kinds: Sequence[str],
    weights: Sequence[float | int] | None = None,
) -> list[Part]:
    """Fill a cell with parts of the named kinds: "open", "shelves", "doors", "drawers", "glass" or "mixed"."""
    kind = pick(rng, kinds, weights)
    if kind == "drawers":
        pitch = between(rng, 0.16, 0.3)
        return drawers(rng, cell, style, int(np.clip(round(cell.height / pitch), 1, 5)), graded=happens(rng, 0.3))
    if kind in ("doors", "glass"):
        count = 1 if cell.width < between(rng, 0.4, 0.65) else 2
        leaf = replace(style, panel=style.pane) if kind == "glass" else style
        parts = doors(cell, leaf, count)
        inner = int(np.clip(cell.height / 0.4, 0, 4)) if kind == "glass" else whole(rng, 0, 1)
        # Boards behind inset doors end at the doors.
        inside = replace(cell, front=cell.front - (style.thickness + 0.004 if style.inset else 0.004))
        return parts + shelves(rng, inside, inner)
    if kind == "shelves":
        return shelves(rng, cell, int(np.clip(round(cell.height / between(rng, 0.22, 0.42)) - 1, 0, 6)), 0.2)
    if kind == "mixed":
        part = between(rng, 0.55, 0.8)
        low, high = cell.rows([part, 1 - part])
        return [shelf_board(high, high.bottom), *fill(rng, low, style, ("doors",)), *drawers(rng, high, style, 1)]
    return []


def divided(
    rng: np.random.Generator, space: Opening, columns: int, uneven: float = 0.0
) -> tuple[list[Part], list[Opening]]:
    """Divide the space into `columns` columns, with standing boards between them."""
    cells = space.columns(fractions(rng, columns, uneven))
    return [upright_board(cell, cell.left) for cell in cells[1:]], cells


def lifted(parts: Sequence[Part], y: float) -> list[Part]:
    """Move the parts up by `y`."""
    return [part.moved((0.0, y, 0.0)) for part in parts]
