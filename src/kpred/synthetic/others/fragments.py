"""What is nearly furniture: loose parts, bare frames, heaps, two pieces in one crop, pieces that lie on their side."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from kpred.synthetic.cabinet.cabinet import CABINET_FAMILIES
from kpred.synthetic.chair.chair import CHAIR_FAMILIES
from kpred.synthetic.chance import between, happens, pick, whole
from kpred.synthetic.parts import Part, beam, box, cylinder, rounded_rectangle, slab
from kpred.synthetic.table.table import TABLE_FAMILIES

Family = Callable[[np.random.Generator], list[Part]]
_FURNITURE = {"chair": CHAIR_FAMILIES, "table": TABLE_FAMILIES, "cabinet": CABINET_FAMILIES}


def _furniture(rng: np.random.Generator, category: str) -> list[Part]:
    families = _FURNITURE[category]
    return _grounded(families[pick(rng, list(families))](rng))


def _box_of(parts: list[Part]) -> tuple[np.ndarray, np.ndarray]:
    points = np.concatenate([part.vertices for part in parts])
    return points.min(axis=0), points.max(axis=0)


def _grounded(parts: list[Part]) -> list[Part]:
    low, high = _box_of(parts)
    middle = (low + high) / 2.0
    return [part.moved((-middle[0], -low[1], -middle[2])) for part in parts]


def loose_part(rng: np.random.Generator) -> list[Part]:
    """Build one part of a chair or table: a leg, a rail, an arm, a small board."""
    parts = _furniture(rng, pick(rng, ["chair", "table"]))
    low, high = _box_of(parts)
    whole_size = float(np.linalg.norm(high - low))
    # A shell or a solid body is the furniture itself; only what is small beside it is a fragment.
    sizes = [float(np.linalg.norm(np.ptp(part.vertices, axis=0))) for part in parts]
    small = [part for part, size in zip(parts, sizes) if 0.06 < size < 0.6 * whole_size]
    return [pick(rng, small) if small else parts[int(np.argmin(sizes))]]


def board(rng: np.random.Generator) -> list[Part]:
    """Build a bare board that lies, stands on an edge or leans."""
    plan = rounded_rectangle(between(rng, 0.2, 2.0), between(rng, 0.15, 1.2), between(rng, 0.0, 0.1))
    plank = slab(plan, 0.0, between(rng, 0.01, 0.06), "board")
    tilt = pick(rng, [0.0, 90.0, between(rng, 50.0, 85.0)])
    return [plank.rotated(pick(rng, ["x", "z"]), tilt)]


def frame(rng: np.random.Generator) -> list[Part]:
    """Build a bare frame: four bars in a plane, or the twelve edges of a block."""
    width, height, depth = between(rng, 0.3, 1.5), between(rng, 0.3, 1.5), between(rng, 0.3, 0.8)
    bar = between(rng, 0.02, 0.06)
    deep = happens(rng, 0.3)
    planes = (0.0, -depth) if deep else (0.0,)
    corners = [(-width / 2.0, 0.0), (width / 2.0, 0.0), (width / 2.0, height), (-width / 2.0, height)]
    parts = []
    for z in planes:
        for (x0, y0), (x1, y1) in zip(corners, corners[1:] + corners[:1]):
            parts.append(beam((x0, y0, z), (x1, y1, z), bar, bar, "bar"))
    if deep:
        # A missing top and bottom bar keeps the block from reading as a table's underframe.
        keep = rng.permutation(4)[: whole(rng, 2, 4)]
        parts += [beam((x, y, 0.0), (x, y, -depth), bar, bar, "bar") for x, y in (corners[k] for k in keep)]
        return [part.rotated("x", between(rng, 15.0, 75.0)) for part in parts]
    return [part.rotated("x", pick(rng, [0.0, 90.0, between(rng, -30.0, 30.0)])) for part in parts]


def heap(rng: np.random.Generator) -> list[Part]:
    """Build boxes and sticks thrown on a heap."""
    size = between(rng, 0.3, 1.0)
    parts: list[Part] = []
    for _ in range(whole(rng, 5, 20)):
        place = rng.normal(0.0, 0.17, 3) * size
        place[1] = abs(place[1])
        if happens(rng, 0.5):
            piece = box(size * rng.uniform(0.1, 0.5, 3), place, "block")
        else:
            reach = rng.normal(size=3)
            reach *= size * between(rng, 0.3, 1.0) / np.linalg.norm(reach)
            piece = cylinder(0.02 * size + 0.005, place - reach / 2.0, place + reach / 2.0, "stick", sides=6)
        parts.append(piece.rotated(rng.normal(size=3), between(rng, 0.0, 180.0), place))
    return parts


def two_pieces(rng: np.random.Generator) -> list[Part]:
    """Build two pieces of furniture beside each other, at any yaw, a chair sometimes pushed under a table."""
    # Two cabinets or two tables in a row are one longer cabinet or table.
    kinds = [("chair", "chair"), ("chair", "table"), ("chair", "cabinet"), ("table", "cabinet")]
    first, second = pick(rng, kinds, (3, 3, 1, 1))
    near, far = _furniture(rng, first), _furniture(rng, second)
    near = [part.rotated("y", between(rng, 0.0, 360.0)) for part in near] if happens(rng, 0.5) else near
    turn = between(rng, 0.0, 360.0)
    far = _grounded([part.rotated("y", turn) for part in far])
    heading = np.radians(between(rng, 0.0, 360.0))
    direction = np.array([np.cos(heading), 0.0, np.sin(heading)])
    gap = between(rng, -0.25, 0.1) if (first, second) == ("chair", "table") else between(rng, 0.0, 0.4)
    reach = sum(_reach(parts, sign * direction) for parts, sign in ((near, 1.0), (far, -1.0)))
    return [*near, *(part.moved(direction * (reach + gap)) for part in far)]


def _reach(parts: list[Part], direction: np.ndarray) -> float:
    return max(float((part.vertices @ direction).max()) for part in parts)


def fallen_furniture(rng: np.random.Generator) -> list[Part]:
    """Build a chair or table on its side, on its back or upside down."""
    # Cabinets are left out: on their side they are cabinets of another size.
    parts = _furniture(rng, pick(rng, ["chair", "table"], (2, 1)))
    axis = pick(rng, ["x", "z"])
    turn = pick(rng, [90.0, -90.0, 180.0]) + (between(rng, -12.0, 12.0) if happens(rng, 0.5) else 0.0)
    return [part.rotated(axis, turn) for part in parts]


FRAGMENT_FAMILIES: dict[str, Family] = {
    "loose_part": loose_part,
    "board": board,
    "frame": frame,
    "heap": heap,
    "two_pieces": two_pieces,
    "fallen_furniture": fallen_furniture,
}
