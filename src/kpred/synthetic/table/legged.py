"""Tables on separate legs: dining, coffee, console, bar, side and garden tables."""

from __future__ import annotations

import numpy as np

from kpred.synthetic.cabinet.fronts import Opening, any_front_style, drawers
from kpred.synthetic.chance import between, happens, pick, whole
from kpred.synthetic.parts import Part, beam, box, cylinder, ellipse, rounded_rectangle, slab
from kpred.synthetic.table.legs import LegStyle, any_leg_style, corners, four_legs, leg_set, rails
from kpred.synthetic.table.tops import any_top_shape, leg_reach, tabletop


def long_side_front(parts: list[Part]) -> list[Part]:
    """Rotate the parts by a quarter turn about y if the whole is deeper (z) than wide (x)."""
    points = np.concatenate([part.vertices for part in parts])
    extent = points.max(axis=0) - points.min(axis=0)
    return [part.rotated("y", 90.0) for part in parts] if extent[2] > extent[0] else parts


def dining_table(rng: np.random.Generator) -> list[Part]:
    """Build four legs of any kind under any top, with or without apron and stretchers."""
    width = between(rng, 0.9, 2.4)
    depth = float(np.clip(width / between(rng, 1.0, 2.7), 0.65, 1.2))
    height, thick = between(rng, 0.68, 0.8), between(rng, 0.015, 0.07)
    shape = any_top_shape(rng, curved=0.25)
    style = any_leg_style(rng, height)
    inset = pick(rng, (0.0, between(rng, 0.02, 0.1), between(rng, 0.1, 0.3))) * depth
    inset = max(inset, 0.02 if shape in ("bevelled", "rounded") else 0.0)
    reach = leg_reach(shape)
    apron = between(rng, 0.06, 0.14) if happens(rng, 0.6) and style.kind != "hairpin" else 0.0
    parts = tabletop(rng, width, depth, height, thick, shape)
    return parts + four_legs(
        rng,
        (width - 2 * inset) * reach,
        (depth - 2 * inset) * reach,
        height - thick,
        style,
        apron,
        stretched=happens(rng, 0.2),
    )


def round_table(rng: np.random.Generator) -> list[Part]:
    """Build a round or octagonal top on three or four legs at any height."""
    size = between(rng, 0.4, 1.5)
    height = between(rng, 0.35, 0.6) if size < 0.9 and happens(rng, 0.6) else between(rng, 0.65, 0.78)
    thick = between(rng, 0.015, 0.05)
    octagon = happens(rng, 0.25)
    outline = ellipse(size, size, 8 if octagon else 32)
    style = any_leg_style(rng, height)
    count = pick(rng, (3, 4, 4, 4, 6) if size > 0.7 else (3, 4))
    radius = size / 2 * between(rng, 0.55, 0.8)
    turn = between(rng, 0, 1) if count == 3 else np.pi / count
    spots = [(radius * np.cos(turn + a), radius * np.sin(turn + a)) for a in 2 * np.pi * np.arange(count) / count]
    parts = [slab(outline, height - thick, thick, "top")] + leg_set(style, spots, height - thick)
    if happens(rng, 0.4) and style.kind != "hairpin":
        tall = between(rng, 0.04, 0.1)
        for (ax, az), (bx, bz) in zip(spots, spots[1:] + spots[:1], strict=True):
            parts.append(
                beam((ax, height - thick - tall / 2, az), (bx, height - thick - tall / 2, bz), 0.02, tall, "apron")
            )
    if happens(rng, 0.3) and style.splay == 0:
        parts.append(slab(ellipse(radius * 2.1, radius * 2.1, 24), height * between(rng, 0.2, 0.4), 0.02, "shelf"))
    return parts


def _apron_drawers(
    rng: np.random.Generator,
    wide: float,
    deep: float,
    top: float,
    apron: float,
    style: LegStyle,
    board: float,
    most: int,
) -> list[Part]:
    """Build one row of up to `most` drawers into the front apron, which hangs from height `top` between the legs."""
    reach, front = wide / 2 - style.thickness, deep / 2 - style.thickness / 2 + 0.011
    opening = Opening(-reach, reach, top - apron, top, 0.0, front, board)
    return drawers(rng, opening, any_front_style(rng), 1, whole(rng, 1, most))


def coffee_table(rng: np.random.Generator) -> list[Part]:
    """Build a low table, with a lower shelf or drawers in many cases."""
    width = between(rng, 0.7, 1.4)
    depth = float(np.clip(width / between(rng, 1.0, 2.4), 0.42, 0.95))
    height, thick = between(rng, 0.3, 0.52), between(rng, 0.012, 0.08)
    shape = any_top_shape(rng, curved=0.25)
    style = any_leg_style(rng, height)
    inset = max(between(rng, 0, 0.12) * depth if happens(rng, 0.6) else 0.0, 0.02 if shape != "rectangle" else 0.0)
    reach = leg_reach(shape)
    wide, deep = (width - 2 * inset) * reach, (depth - 2 * inset) * reach
    shelf = height * between(rng, 0.18, 0.45) if happens(rng, 0.5) else None
    apron = between(rng, 0.04, 0.1) if happens(rng, 0.5) else 0.0
    parts = tabletop(rng, width, depth, height, thick, shape)
    parts += four_legs(rng, wide, deep, height - thick, style, apron, stretched=happens(rng, 0.15), shelf=shelf)
    if apron > 0.06 and happens(rng, 0.6):
        parts += _apron_drawers(rng, wide, deep, height - thick, apron, style, 0.01, 3)
    return parts


def console_table(rng: np.random.Generator) -> list[Part]:
    """Build a narrow, high table for a hall, with drawers or shelves."""
    width, depth = between(rng, 0.75, 1.6), between(rng, 0.28, 0.48)
    height, thick = between(rng, 0.72, 0.95), between(rng, 0.015, 0.045)
    style = any_leg_style(rng, height, ("square", "tapered", "turned", "round", "cabriole", "angle", "tube"))
    inset = between(rng, 0.0, 0.04)
    wide, deep = width - 2 * inset, depth - 2 * inset
    apron = between(rng, 0.09, 0.18) if happens(rng, 0.7) else 0.0
    shelf = height * between(rng, 0.12, 0.35) if happens(rng, 0.5) and style.kind != "cabriole" else None
    shape = pick(rng, ("rectangle", "rectangle", "bevelled", "rounded"))
    parts = tabletop(rng, width, depth, height, thick, shape)
    parts += four_legs(rng, wide, deep, height - thick, style, apron, shelf=shelf)
    if shelf is not None and happens(rng, 0.3) and style.splay == 0:
        parts.append(
            box((wide - 0.3 * style.thickness, 0.02, deep - 0.3 * style.thickness), (0, shelf + 0.22, 0), "shelf")
        )
    if apron and happens(rng, 0.75):
        parts += _apron_drawers(rng, wide, deep, height - thick, apron, style, 0.012, 4)
    return parts


def bar_table(rng: np.random.Generator) -> list[Part]:
    """Build a high table with foot rests between its legs."""
    width = between(rng, 0.5, 1.8)
    depth = float(np.clip(width / between(rng, 1.0, 3.0), 0.45, 0.8))
    height, thick = between(rng, 0.88, 1.1), between(rng, 0.02, 0.06)
    style = any_leg_style(rng, height, ("square", "tapered", "round", "tube", "square"))
    inset = between(rng, 0.01, 0.06)
    wide, deep = width - 2 * inset, depth - 2 * inset
    parts = tabletop(rng, width, depth, height, thick, pick(rng, ("rectangle", "rounded", "planks", "bevelled")))
    parts += four_legs(rng, wide, deep, height - thick, style, between(rng, 0.05, 0.12) if happens(rng, 0.6) else 0.0)
    rest = height * between(rng, 0.2, 0.3)
    grow = style.splay * (1 - rest / height) * np.sqrt(2.0)
    w, d = wide - style.thickness + grow, deep - style.thickness + grow
    return parts + rails(w, d, rest, 0.03, 0.03, "stretcher")


def frame_table(rng: np.random.Generator) -> list[Part]:
    """Build a frame of equal square bars along all edges of a box, with a panel on top."""
    width = between(rng, 0.4, 1.6)
    depth = float(np.clip(width / between(rng, 1.0, 3.0), 0.35, 0.9))
    height, bar = between(rng, 0.35, 0.85), between(rng, 0.02, 0.05)
    style = LegStyle("square", bar, 1.0, 0.0, 1.0)
    parts = leg_set(style, corners(width - bar, depth - bar), height - bar)
    parts += rails(width - bar, depth - bar, height - bar / 2, bar, bar, "frame")
    low = pick(rng, (bar / 2, height * 0.2, height * 0.4))
    parts += rails(width - bar, depth - bar, low, bar, bar, "frame")
    over = happens(rng, 0.4)
    thick = between(rng, 0.008, 0.03)
    if over:
        parts.append(box((width + 0.04, thick, depth + 0.04), (0, height + thick / 2 - 0.001, 0), "top"))
    else:
        parts.append(box((width - 1.8 * bar, bar * 0.6, depth - 1.8 * bar), (0, height - bar * 0.3, 0), "top"))
    if happens(rng, 0.55):
        parts.append(box((width - 1.8 * bar, bar * 0.5, depth - 1.8 * bar), (0, low, 0), "shelf"))
    return parts


def nesting_tables(rng: np.random.Generator) -> list[Part]:
    """Build two or three tables of falling size, the small ones drawn out to the side or to the front."""
    count = whole(rng, 2, 3)
    width, depth = between(rng, 0.5, 0.8), between(rng, 0.35, 0.5)
    height, thick = between(rng, 0.45, 0.6), between(rng, 0.015, 0.03)
    style = any_leg_style(rng, height, ("square", "round", "tapered"))
    style = LegStyle(style.kind, between(rng, 0.025, 0.04), style.taper, 0.0, style.waist)
    pulled, aside = between(rng, 0.0, 0.5), between(rng, 0.0, 0.5) if happens(rng, 0.5) else 0.0
    parts: list[Part] = []
    for step in range(count):
        w, d = width - step * 2.6 * style.thickness, depth - step * 0.02
        h = height - step * (thick + 0.025)
        nested = tabletop(rng, w, d, h, thick, "rectangle") + four_legs(rng, w, d, h - thick, style)
        # The feet of all stand on one floor; thin runners tie the group, as the tops of a nest slide in rails.
        if step:
            rail = 0.027
            nested += [
                box((0.015, rail, d * 0.9), (side * (w / 2 - 0.02), h + rail / 2 - 0.001, 0), "runner")
                for side in (-1, 1)
            ]
        parts += [part.moved((step * aside * width, 0, step * pulled * depth * (aside == 0))) for part in nested]
    return long_side_front(parts)


def picnic_table(rng: np.random.Generator) -> list[Part]:
    """Build a plank top and two benches on A-frames of slanted legs."""
    width, depth = between(rng, 1.6, 2.5), between(rng, 0.6, 0.78)
    height, seat = between(rng, 0.7, 0.78), between(rng, 0.42, 0.47)
    thick, reach = between(rng, 0.03, 0.045), between(rng, 0.5, 0.62)
    parts = tabletop(rng, width, depth, height, thick, "planks")
    foot = depth / 2 + between(rng, 0.0, 0.25)
    for side in (-1, 1):
        x = side * width * 0.34
        for z in (-1, 1):
            parts.append(beam((x, 0, z * foot), (x, height - thick, z * depth * 0.25), 0.045, 0.09, "leg"))
        bar = 0.09
        parts.append(box((0.045, bar, 2 * reach + 0.2), (x + side * 0.045, seat - 0.035 - bar / 2, 0), "support"))
        parts.append(box((0.045, bar, depth * 0.85), (x + side * 0.045, height - thick - bar / 2, 0), "support"))
    for z in (-1, 1):
        for k in range(2):
            parts.append(box((width, 0.036, 0.125), (0, seat - 0.018, z * (reach - 0.035 + k * 0.135)), "bench"))
    return long_side_front(parts)


def drop_leaf_table(rng: np.random.Generator) -> list[Part]:
    """Build a narrow middle top with flaps at its ends, hanging or one of them raised."""
    width, depth = between(rng, 0.4, 0.9), between(rng, 0.65, 0.95)
    height, thick = between(rng, 0.7, 0.78), between(rng, 0.018, 0.03)
    style = any_leg_style(rng, height, ("square", "tapered", "turned", "round_tapered"))
    style = LegStyle(style.kind, min(style.thickness, 0.06), style.taper, 0.0, style.waist)
    flap = between(rng, 0.22, 0.5)
    parts = tabletop(rng, width, depth, height, thick, "rectangle")
    parts += four_legs(rng, width - 0.02, depth * 0.85, height - thick, style, 0.11, stretched=happens(rng, 0.5))
    outline = rounded_rectangle(2 * flap, depth, pick(rng, (0.03, flap * 0.5, flap * 0.99)), 6)
    half = outline[outline[:, 0] >= 0]
    half = np.concatenate([half, [[0.0, -depth / 2], [0.0, depth / 2]]])
    order = np.argsort(np.arctan2(half[:, 1], half[:, 0] - flap * 0.3))
    raised = happens(rng, 0.4)
    for side in (-1, 1):
        leaf = slab(half[order], height - thick, thick, "leaf").moved((width / 2, 0, 0))
        if not (raised and side == 1):
            leaf = leaf.rotated("z", -90.0, (width / 2, height - thick * 0.9, 0)).moved((0.0, 0, 0))
        parts.append(leaf if side == 1 else leaf.mirrored_x())
    if raised:
        parts.append(
            beam(
                (width / 2 - 0.02, height - thick - 0.05, 0),
                (width / 2 + flap * 0.7, height - thick - 0.03, 0),
                0.03,
                0.06,
                "gate",
            )
        )
    return long_side_front(parts)


def drawer_side_table(rng: np.random.Generator) -> list[Part]:
    """Build a bedside table: a box with a drawer or an open bay, on four legs, often with a shelf below."""
    width = between(rng, 0.35, 0.68)
    depth = width / between(rng, 1.0, 1.5)
    height, thick = between(rng, 0.45, 0.75), between(rng, 0.015, 0.03)
    style = any_leg_style(rng, height, ("square", "tapered", "turned", "round_tapered"))
    style = LegStyle(style.kind, min(style.thickness, 0.05), style.taper, style.splay * 0.5, style.waist)
    over = pick(rng, (0.0, 0.015, 0.03))
    wide, deep = width - 2 * over, depth - 2 * over
    case = between(rng, 0.12, 0.24) * (1 + 0.4 * happens(rng, 0.3))
    floor = height - thick - case
    parts = tabletop(rng, width, depth, height, thick, pick(rng, ("rectangle", "bevelled")))
    shelf = between(rng, 0.15, 0.6) * floor if happens(rng, 0.5) else None
    low = shelf if shelf is not None and floor - shelf > 0.1 else None
    parts += four_legs(rng, wide, deep, floor + 0.01, style, shelf=low)
    board = 0.018
    parts.append(box((wide, board, deep), (0, floor + board / 2, 0), "bottom"))
    parts += [box((board, case, deep), (side * (wide - board) / 2, floor + case / 2, 0), "side") for side in (-1, 1)]
    parts.append(box((wide, case, 0.01), (0, floor + case / 2, -deep / 2 + 0.005), "back"))
    front = Opening(
        -wide / 2 + board / 2, wide / 2 - board / 2, floor + board / 2, height - thick, -deep / 2, deep / 2, board
    )
    if happens(rng, 0.85):
        parts += drawers(rng, front, any_front_style(rng), 2 if case > 0.25 and happens(rng, 0.7) else 1)
    return parts


def workbench(rng: np.random.Generator) -> list[Part]:
    """Build a heavy table with thick legs, beams, a lower shelf, and often a vice, a drawer or a tool board."""
    width, depth = between(rng, 1.1, 2.2), between(rng, 0.55, 0.8)
    height, thick, post = between(rng, 0.78, 0.95), between(rng, 0.05, 0.1), between(rng, 0.07, 0.11)
    style = LegStyle("square", post, 1.0, 0.0, 1.0)
    inset = between(rng, 0.0, 0.12)
    wide = width - 2 * inset
    parts = tabletop(rng, width, depth, height, thick, "rectangle")
    shelf = between(rng, 0.12, 0.3) if happens(rng, 0.8) else None
    parts += four_legs(rng, wide, depth - 0.02, height - thick, style, 0.1, shelf=shelf)
    if shelf is not None:
        parts += rails(wide - post, depth - 0.02 - post, shelf - 0.04, 0.08, 0.035, "stretcher")
    if happens(rng, 0.4):
        x, y, z = -width * 0.28, height - 0.075, depth / 2
        parts += [box((0.3, 0.14, 0.04), (x, y, z + away), "vice") for away in (0.019, 0.11)]
        parts.append(cylinder(0.015, (x, y, z + 0.02), (x, y, z + 0.2), "vice", 8))
    if happens(rng, 0.4):
        front = Opening(
            width * 0.05, wide / 2 - post, height - thick - 0.16, height - thick, 0.0, depth / 2 - 0.03, 0.02
        )
        parts.append(box((front.width, 0.16, depth * 0.8), (front.middle[0], front.middle[1], -0.02), "case"))
        parts += drawers(rng, front, any_front_style(rng), 1, whole(rng, 1, 2))
    if happens(rng, 0.3):
        board = between(rng, 0.3, 0.6)
        parts.append(box((width, board, 0.02), (0, height + board / 2, -depth / 2 + 0.01), "tool_board"))
    return parts
