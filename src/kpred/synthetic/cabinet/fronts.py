"""What closes a cabinet's openings: drawers, doors, flaps, with their handles; desks and tables use the drawers too."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from kpred.synthetic.chance import between, fractions, happens, pick
from kpred.synthetic.parts import Part, box, cylinder, frustum

HANDLES = ("knob", "square_knob", "bar", "rod", "cup", "edge", "none")
PANELS = ("flat", "framed", "raised", "chamfered", "slatted")


@dataclass(frozen=True)
class Opening:
    """A box-shaped space of a cabinet: x left to right, y bottom to top, z rear to front, metres.

    Its faces in x and y run through the middles of the boards (`board` thick) that bound it.
    """

    left: float
    right: float
    bottom: float
    top: float
    rear: float
    front: float
    board: float

    @property
    def width(self) -> float:
        """Extent along x."""
        return self.right - self.left

    @property
    def height(self) -> float:
        """Extent along y."""
        return self.top - self.bottom

    @property
    def depth(self) -> float:
        """Extent along z."""
        return self.front - self.rear

    @property
    def middle(self) -> tuple[float, float, float]:
        """Centre (x, y, z)."""
        return (self.left + self.right) / 2, (self.bottom + self.top) / 2, (self.rear + self.front) / 2

    def columns(self, parts: Sequence[float]) -> list[Opening]:
        """Split along x, left to right, by fractions with sum 1."""
        edges = self.left + self.width * np.concatenate([[0.0], np.cumsum(parts)])
        return [replace(self, left=float(a), right=float(b)) for a, b in zip(edges[:-1], edges[1:], strict=True)]

    def rows(self, parts: Sequence[float]) -> list[Opening]:
        """Split along y, bottom to top, by fractions with sum 1."""
        edges = self.bottom + self.height * np.concatenate([[0.0], np.cumsum(parts)])
        return [replace(self, bottom=float(a), top=float(b)) for a, b in zip(edges[:-1], edges[1:], strict=True)]


@dataclass(frozen=True)
class FrontStyle:
    """How the doors and drawers of one piece look, so that they match."""

    inset: bool
    thickness: float
    panel: str
    handle: str
    handle_size: float
    gap: float
    pane: str = "glass"  # how doors of glass look: with panes, or bars ("muntin") alone

    def bounds(self, opening: Opening) -> tuple[float, float, float, float, float]:
        """Return (left, right, bottom, top, z of the rear face) of a front that closes the opening."""
        shrink = opening.board / 2 + 0.002 if self.inset else self.gap / 2
        rear = opening.front - self.thickness if self.inset else opening.front - 0.001
        return (opening.left + shrink, opening.right - shrink, opening.bottom + shrink, opening.top - shrink, rear)


def any_front_style(rng: np.random.Generator) -> FrontStyle:
    """Draw a style for one piece's fronts."""
    return FrontStyle(
        inset=happens(rng, 0.35),
        thickness=between(rng, 0.016, 0.024),
        panel=pick(rng, PANELS, (6, 3, 2, 1, 0.6)),
        handle=pick(rng, HANDLES, (4, 1, 3, 3, 1, 1, 1)),
        handle_size=between(rng, 0.75, 1.4),
        gap=between(rng, 0.004, 0.012),
        pane=pick(rng, ("glass", "muntin")),
    )


def handle(style: FrontStyle, x: float, y: float, z: float, upright: bool, room: float) -> list[Part]:
    """Build a handle on a front face at `z`, up to `room` long, along y if `upright`, else along x."""
    size = style.handle_size
    if style.handle == "none":
        return []
    if style.handle == "knob":
        radius = min(0.016 * size, room * 0.3)
        return [
            cylinder(radius * 0.5, (x, y, z - 0.002), (x, y, z + 0.016), "handle", sides=6),
            cylinder(radius * 0.8, (x, y, z + 0.015), (x, y, z + 0.03), "handle", sides=8, end_radius=radius),
        ]
    if style.handle == "square_knob":
        edge = min(0.03 * size, room * 0.5)
        return [box((edge, edge, 0.025), (x, y, z + 0.0115), "handle")]
    length = min(0.14 * size if not upright else 0.2 * size, room * 0.8)
    along = np.array([0.0, 1.0, 0.0]) if upright else np.array([1.0, 0.0, 0.0])
    at = np.array([x, y, z])
    if style.handle == "edge":
        extent = np.array([0.012, 0.012, 0.02]) + along * (length * 1.2)
        return [box(tuple(extent), (x, y, z + 0.008), "handle")]
    if style.handle == "cup":
        wide, tall = (0.03, length * 0.6) if upright else (length * 0.7, 0.03)
        centre = (x, y)
        return [
            frustum(
                (wide, 0.03),
                (wide, 0.008),
                (centre[0], y - tall / 2, z + 0.013),
                (centre[0], y + tall / 2, z + 0.003),
                "handle",
            )
        ]
    reach = 0.03
    feet = [at + along * length * 0.42 * side for side in (-1, 1)]
    out = np.array([0.0, 0.0, reach])
    if style.handle == "rod":
        posts = [cylinder(0.004, foot - [0, 0, 0.002], foot + out, "handle", sides=4) for foot in feet]
        return posts + [
            cylinder(0.006, at + out - along * length / 2, at + out + along * length / 2, "handle", sides=6)
        ]
    posts = [box((0.01, 0.01, reach), tuple(foot + out / 2 - [0, 0, 0.001]), "handle") for foot in feet]
    extent = np.array([0.013, 0.013, 0.008]) + along * length
    return posts + [box(tuple(extent), tuple(at + out), "handle")]


def panel(style: FrontStyle, bounds: tuple[float, float, float, float, float], label: str) -> list[Part]:
    """Build a front's leaf without handle, flat or with a frame; `bounds` as from `FrontStyle.bounds`."""
    left, right, bottom, top, rear = bounds
    width, height, thick = right - left, top - bottom, style.thickness
    x, y, z = (left + right) / 2, (bottom + top) / 2, rear + thick / 2
    rim = min(0.07, 0.28 * min(width, height))
    if style.panel in ("framed", "glass", "muntin", "slatted") and min(width, height) > 0.1:
        parts = [box((rim, height, thick), (x + side * (width - rim) / 2, y, z), label) for side in (-1, 1)] + [
            box((width - 2 * rim, rim, thick), (x, y + side * (height - rim) / 2, z), label) for side in (-1, 1)
        ]
        inner = (width - 2 * rim, height - 2 * rim)
        if style.panel == "slatted":
            count = max(2, min(7, int(inner[1] / 0.05)))
            pitch = inner[1] / count
            return parts + [
                box((inner[0], pitch * 0.7, thick * 0.5), (x, bottom + rim + (i + 0.5) * pitch, z), label)
                for i in range(count)
            ]
        if style.panel == "muntin":
            # Bars only: a scanner looks through clear panes, and many models leave them out.
            count = max(1, min(4, round(inner[1] / 0.3) - 1))
            bars = [box((0.018, inner[1], thick * 0.7), (x, y, z), label)] if inner[0] > 0.2 else []
            levels = bottom + rim + inner[1] * np.arange(1, count + 1) / (count + 1)
            return parts + bars + [box((inner[0], 0.018, thick * 0.6), (x, float(level), z), label) for level in levels]
        leaf = "glass" if style.panel == "glass" else label
        thin = 0.004 if style.panel == "glass" else thick * 0.4
        return parts + [box((inner[0], inner[1], thin), (x, y, z - thick * 0.2), leaf)]
    if style.panel == "chamfered":
        face = frustum((width, height), (width - 0.016, height - 0.016), (0, 0, 0), (0, thick, 0), label)
        return [face.rotated((1.0, 0.0, 0.0), 90.0, (0.0, 0.0, 0.0)).moved((x, y, rear))]
    parts = [box((width, height, thick), (x, y, z), label)]
    if style.panel == "raised" and min(width, height) > 0.1:
        parts.append(box((width - 2 * rim, height - 2 * rim, 0.01), (x, y, rear + thick + 0.004), label))
    return parts


def _face(style: FrontStyle, rear: float, middle: bool) -> float:
    """Return the z of a front's face where its handle sits: in the `middle`, or on the rim."""
    if middle and style.panel == "framed":
        return rear + style.thickness / 2
    if middle and style.panel == "raised":
        return rear + style.thickness + 0.009
    return rear + style.thickness


def drawer(opening: Opening, style: FrontStyle, pulls: int = 1) -> list[Part]:
    """Build a closed drawer: its front and one or two handles."""
    if style.panel in ("glass", "muntin", "slatted"):
        style = replace(style, panel="flat")
    bounds = left, right, bottom, top, rear = style.bounds(opening)
    parts = panel(style, bounds, "drawer")
    small = min(right - left, top - bottom) <= 0.1
    z = _face(replace(style, panel="flat") if small else style, rear, middle=style.handle != "edge")
    y = (bottom + top) / 2
    if style.handle in ("edge", "cup") and style.panel != "framed":
        y = top - min(0.035, (top - bottom) * 0.3)
    spots = [0.5] if pulls == 1 else [0.24, 0.76]
    for spot in spots:
        x = left + (right - left) * spot
        room = right - left if pulls == 1 else (right - left) * 0.4
        parts += handle(style, x, y, z, upright=False, room=min(room, right - left))
    return parts


def door(opening: Opening, style: FrontStyle, hinge: int) -> list[Part]:
    """Build a closed door, hung on its left (`hinge` -1) or right side (+1), with the handle opposite."""
    bounds = left, right, bottom, top, rear = style.bounds(opening)
    parts = panel(style, bounds, "door")
    rim = min(0.07, 0.28 * min(right - left, top - bottom)) / 2 if style.panel != "flat" else 0.035
    rim = min(rim, (right - left) * 0.2)
    x = left + rim if hinge > 0 else right - rim
    y = (bottom + top) / 2
    if top - bottom < 0.9:
        y = top - 0.28 * (top - bottom) if bottom < 0.9 else bottom + 0.25 * (top - bottom)
    return parts + handle(style, x, y, _face(style, rear, middle=False), True, (top - bottom) * 0.5)


def doors(opening: Opening, style: FrontStyle, count: int) -> list[Part]:
    """Build `count` doors side by side; pairs open from their common middle."""
    parts: list[Part] = []
    for index, column in enumerate(opening.columns([1 / count] * count)):
        # Neighbouring leaves share one gap, without a board between them.
        edge = opening.board / 2 if style.inset else 0.0
        left = column.left if index == 0 else column.left - edge
        right = column.right if index == count - 1 else column.right + edge
        hinge = -1 if index % 2 == 0 else 1
        parts += door(replace(column, left=left, right=right), style, hinge)
    return parts


def drawers(
    rng: np.random.Generator, opening: Opening, style: FrontStyle, rows: int, columns: int = 1, graded: bool = False
) -> list[Part]:
    """Build a block of drawers; `graded`: the lower ones are higher."""
    if rows * columns > 8 and style.panel == "framed":
        style = replace(style, panel="raised")  # many frames would cost many triangles
    heights = fractions(rng, rows, 0.0)
    if graded:
        weights = np.linspace(1.5, 1.0, rows)
        heights = [float(weight) for weight in weights / weights.sum()]
    parts: list[Part] = []
    for row_index, row in enumerate(opening.rows(heights)):
        if row_index:
            parts.append(shelf_board(row, row.bottom, "rail"))
        for index, cell in enumerate(row.columns([1 / columns] * columns)):
            if index:
                parts.append(upright_board(cell, cell.left))
            wide = (
                cell.width > 0.55
                and rows * columns < 9
                and style.handle in ("knob", "square_knob", "cup", "bar", "rod")
            )
            parts += drawer(cell, style, pulls=2 if wide else 1)
    return parts


def shelf_board(opening: Opening, y: float, label: str = "shelf", setback: float = 0.0) -> Part:
    """Build a board across the opening at the height `y` of its middle, `setback` behind the front."""
    size = (opening.width, opening.board, opening.depth - setback)
    return box(size, (opening.middle[0], y, opening.middle[2] - setback / 2), label)


def upright_board(opening: Opening, x: float, label: str = "divider") -> Part:
    """Build a standing board at `x` from the opening's bottom to its top."""
    return box((opening.board, opening.height, opening.depth), (x, opening.middle[1], opening.middle[2]), label)


def shelves(rng: np.random.Generator, opening: Opening, count: int, uneven: float = 0.0) -> list[Part]:
    """Build `count` boards inside the opening, at equal or (`uneven` > 0) unequal distances."""
    return [shelf_board(row, row.bottom) for row in opening.rows(fractions(rng, count + 1, uneven))[1:]]
