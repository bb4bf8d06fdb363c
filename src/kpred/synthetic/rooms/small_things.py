"""Small things that lie on furniture and floors: books, boxes, screens, laptops, cups, papers, pillows, bags."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from kpred.shapes.mesh import Mesh
from kpred.synthetic.assembly import assemble
from kpred.synthetic.chance import between, happens, whole
from kpred.synthetic.parts import Part, box, cushion, cylinder

Small = Callable[[np.random.Generator], list[Part]]


def book_row(rng: np.random.Generator) -> list[Part]:
    """Build a books side by side, some of them leaning."""
    parts, along = [], 0.0
    for _ in range(whole(rng, 3, 14)):
        wide, tall, deep = between(rng, 0.012, 0.05), between(rng, 0.17, 0.3), between(rng, 0.12, 0.22)
        book = box((wide, tall, deep), (along + wide / 2, tall / 2, between(rng, -0.02, 0.02)), "book")
        if happens(rng, 0.1):
            book = book.rotated("z", -between(rng, 3.0, 12.0), (along, 0.0, 0.0))
        parts.append(book)
        along += wide + (between(rng, 0.0, 0.03) if happens(rng, 0.2) else 0.001)
    return parts


def book_pile(rng: np.random.Generator) -> list[Part]:
    """Build a books or papers on top of each other."""
    parts, height = [], 0.0
    for _ in range(whole(rng, 1, 7)):
        wide, thick, deep = between(rng, 0.14, 0.24), between(rng, 0.008, 0.045), between(rng, 0.2, 0.32)
        page = box((wide, thick, deep), (0.0, height + thick / 2, 0.0), "book")
        parts.append(page.rotated("y", float(rng.normal(0.0, 8.0))))
        height += thick
    return parts


def carton(rng: np.random.Generator) -> list[Part]:
    """Build a box, or two on each other."""
    size = (between(rng, 0.12, 0.45), between(rng, 0.06, 0.32), between(rng, 0.12, 0.35))
    parts = [box(size, (0.0, size[1] / 2, 0.0), "box")]
    if happens(rng, 0.25):
        upper = [0.8 * side for side in size]
        parts.append(box(upper, (0.0, size[1] + upper[1] / 2, 0.0), "box").rotated("y", between(rng, -20.0, 20.0)))
    return parts


def monitor(rng: np.random.Generator) -> list[Part]:
    """Build a screen on a foot."""
    wide, tall, lift = between(rng, 0.36, 0.7), between(rng, 0.24, 0.4), between(rng, 0.06, 0.18)
    parts = [box((wide, tall, between(rng, 0.02, 0.06)), (0.0, lift + tall / 2, 0.0), "screen")]
    parts.append(box((0.06, lift + 0.1, 0.03), (0.0, (lift + 0.1) / 2, -0.04), "neck"))
    parts.append(box((0.25, 0.015, 0.18), (0.0, 0.0075, -0.02), "foot"))
    return parts


def old_monitor(rng: np.random.Generator) -> list[Part]:
    """Build a deep screen, or a microwave oven, or a printer: a block with a step."""
    wide, tall, deep = between(rng, 0.3, 0.5), between(rng, 0.2, 0.42), between(rng, 0.28, 0.45)
    parts = [box((wide, tall, 0.5 * deep), (0.0, tall / 2, 0.25 * deep), "body")]
    parts.append(box((0.8 * wide, 0.7 * tall, 0.5 * deep), (0.0, 0.4 * tall, -0.25 * deep), "back"))
    return parts


def keyboard(rng: np.random.Generator) -> list[Part]:
    """Build a keyboard and a mouse."""
    parts = [box((between(rng, 0.35, 0.46), 0.025, 0.15), (0.0, 0.0125, 0.0), "keyboard")]
    return [*parts, box((0.06, 0.03, 0.1), (0.3, 0.015, between(rng, -0.03, 0.05)), "mouse")]


def laptop(rng: np.random.Generator) -> list[Part]:
    """Build an open laptop."""
    wide, deep = between(rng, 0.28, 0.38), between(rng, 0.2, 0.26)
    lid = box((wide, deep, 0.008), (0.0, deep / 2, 0.0), "lid").rotated("x", -between(rng, 0.0, 35.0))
    return [box((wide, 0.02, deep), (0.0, 0.01, 0.0), "base"), lid.moved((0.0, 0.02, -deep / 2))]


def cups(rng: np.random.Generator) -> list[Part]:
    """Build one to three cups, cans or bottles."""
    parts = []
    for n in range(whole(rng, 1, 3)):
        radius, tall = between(rng, 0.025, 0.05), between(rng, 0.07, 0.3)
        x, z = 0.12 * n, between(rng, -0.05, 0.05)
        narrow = radius * between(rng, 0.4, 1.1)
        parts.append(cylinder(radius, (x, 0.0, z), (x, tall, z), "cup", sides=10, end_radius=narrow))
    return parts


def telephone(rng: np.random.Generator) -> list[Part]:
    """Build a telephone, or another flat device."""
    return [
        box((between(rng, 0.1, 0.25), between(rng, 0.03, 0.09), between(rng, 0.12, 0.25)), (0.0, 0.03, 0.0), "body")
    ]


def pillow(rng: np.random.Generator) -> list[Part]:
    """Build a cushion, leaning or lying."""
    size = (between(rng, 0.35, 0.6), between(rng, 0.1, 0.18), between(rng, 0.3, 0.45))
    part = cushion(size, (0.0, size[1] / 2, 0.0), "pillow", radius=0.06)
    return [part.rotated("x", between(rng, 40.0, 75.0)) if happens(rng, 0.3) else part]


def folded_cloth(rng: np.random.Generator) -> list[Part]:
    """Build a clothes or a blanket in a heap of soft pieces."""
    parts = []
    for _ in range(whole(rng, 2, 4)):
        size = (between(rng, 0.15, 0.4), between(rng, 0.04, 0.1), between(rng, 0.15, 0.35))
        place = (between(rng, -0.08, 0.08), between(rng, 0.03, 0.1), between(rng, -0.08, 0.08))
        parts.append(cushion(size, place, "cloth").rotated("y", between(rng, 0.0, 90.0)))
    return parts


def bag(rng: np.random.Generator) -> list[Part]:
    """Build a standing bag."""
    wide, tall, deep = between(rng, 0.25, 0.45), between(rng, 0.2, 0.45), between(rng, 0.1, 0.22)
    parts = [cushion((wide, tall, deep), (0.0, tall / 2, 0.0), "bag")]
    return [*parts, box((0.4 * wide, 0.12, 0.02), (0.0, tall + 0.05, 0.0), "handle")]


def bin_(rng: np.random.Generator) -> list[Part]:
    """Build a waste bin."""
    radius, tall = between(rng, 0.1, 0.18), between(rng, 0.25, 0.45)
    narrow = 0.8 * radius
    return [cylinder(narrow, (0.0, 0.0, 0.0), (0.0, tall, 0.0), "bin", sides=12, end_radius=radius)]


def heap(rng: np.random.Generator) -> list[Part]:
    """Build a pile of things of all kinds, that lie on and across each other."""
    reach, parts = between(rng, 0.08, 0.3), []
    for _ in range(whole(rng, 4, 12)):
        size = (between(rng, 0.04, 0.25), between(rng, 0.02, 0.15), between(rng, 0.04, 0.25))
        x, z = (float(rng.normal(0.0, 0.5 * reach)) for _ in range(2))
        low = between(rng, 0.0, max(0.02, 0.6 * (reach - float(np.hypot(x, z)))))
        make = cushion if happens(rng, 0.4) else box
        part = make(size, (x, low + size[1] / 2, z), "heap").rotated("y", between(rng, 0.0, 180.0))
        parts.append(part.rotated("x", float(rng.normal(0.0, 12.0)), (x, low, z)))
    return parts


def computer(rng: np.random.Generator) -> list[Part]:
    """Build a computer's case that stands on the floor."""
    size = (between(rng, 0.16, 0.22), between(rng, 0.36, 0.48), between(rng, 0.4, 0.5))
    return [box(size, (0.0, size[1] / 2, 0.0), "case")]


ON_DESKS: dict[str, Small] = {
    "books": book_pile,
    "paper": book_pile,
    "monitor": monitor,
    "screen": monitor,
    "keyboard": keyboard,
    "laptop": laptop,
    "cups": cups,
    "telephone": telephone,
    "device": old_monitor,
    "box": carton,
    "book row": book_row,
    "heap": heap,
}
ON_TABLES: dict[str, Small] = {
    "cups": cups,
    "books": book_pile,
    "laptop": laptop,
    "box": carton,
    "bag": bag,
    "heap": heap,
}
ON_SHELVES: dict[str, Small] = {
    "books": book_row,
    "more books": book_row,
    "pile": book_pile,
    "box": carton,
    "cups": cups,
    "device": old_monitor,
    "heap": heap,
}
ON_SEATS: dict[str, Small] = {"clothes": folded_cloth, "pillow": pillow, "bag": bag}
ON_FLOORS: dict[str, Small] = {
    "box": carton,
    "bag": bag,
    "bin": bin_,
    "computer": computer,
    "pile": book_pile,
    "heap": heap,
}


def small_thing(kinds: dict[str, Small], rng: np.random.Generator) -> tuple[str, Mesh]:
    """Draw the name and the mesh (metres, floor at y = 0) of a small thing."""
    names = list(kinds)
    name = names[int(rng.integers(len(names)))]
    return name, assemble(kinds[name](rng), name)
