"""Seats, and the frame in which legs, backs and arms are fitted to them."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from kpred.synthetic.chair.backs import BACK_STYLES, Bend
from kpred.synthetic.chance import between, happens, pick, whole
from kpred.synthetic.parts import Part, box, cushion, ellipse, loft, rounded_rectangle, slab

SEAT_STYLES = ("board", "rounded", "trapezoid", "cushion", "board_cushion", "slatted", "bent")

# Their pads have no inner vertices that could follow a bend, the bars that hold them have.
_STIFF = ("upholstered", "stem", "oval")


@dataclass(frozen=True)
class Seat:
    """Plan (about the origin), height of the sitting surface and thickness of a seat, in metres."""

    width: float
    depth: float
    top: float
    thickness: float

    @property
    def bottom(self) -> float:
        """Height of the underside."""
        return self.top - self.thickness


def seat_size(
    rng: np.random.Generator,
    width: tuple[float, float] = (0.38, 0.6),
    height: tuple[float, float] = (0.38, 0.5),
    thickness: tuple[float, float] = (0.018, 0.09),
) -> Seat:
    """Draw a seat within the given ranges; its depth depends on its width."""
    wide = between(rng, *width)
    deep = float(np.clip(wide * between(rng, 0.8, 1.15), 0.34, 0.75))
    low, high = thickness
    # Thin seats are more common than thick ones.
    return Seat(wide, deep, between(rng, *height), low + (high - low) * float(rng.random()) ** 1.7)


def seat_parts(rng: np.random.Generator, seat: Seat, style: str) -> list[Part]:
    """Build the seat in one of SEAT_STYLES or "round", filling the height from `seat.bottom` to `seat.top`."""
    w, d, t = seat.width, seat.depth, seat.thickness
    center = (0.0, seat.top - t / 2.0, 0.0)
    if style == "board":
        return [box((w, t, d), center, "seat")]
    if style == "round":
        return [slab(ellipse(w, d, 24), seat.bottom, t, "seat")]
    if style == "rounded":
        return [slab(rounded_rectangle(w, d, between(rng, 0.015, 0.045), 3), seat.bottom, t, "seat")]
    if style == "trapezoid":
        rear = w * between(rng, 0.8, 0.95)
        outline = np.array([[w / 2, d / 2], [-w / 2, d / 2], [-rear / 2, -d / 2], [rear / 2, -d / 2]])
        return [slab(outline, seat.bottom, t, "seat")]
    if style == "cushion":
        return [
            cushion(
                (w, max(t, 0.04), d), (0.0, seat.top - max(t, 0.04) / 2.0, 0.0), "seat", between(rng, 0.01, 0.03), 3
            )
        ]
    if style == "board_cushion":
        pad = between(rng, 0.03, 0.07)
        soft = cushion((w * 0.94, pad, d * 0.94), (0.0, seat.top + pad / 2.0 - 0.004, 0.01), "seat_cushion", 0.02, 3)
        return [box((w, t, d), center, "seat"), soft]
    if style == "slatted":
        count = whole(rng, 3, 7)
        pitch = d / count
        strip = pitch * between(rng, 0.6, 0.88)
        thin = min(t, 0.03)
        boards = []
        for k in range(count):
            z = -d / 2.0 + strip / 2.0 + k * (d - strip) / (count - 1)
            boards.append(box((w, thin, strip), (0.0, seat.top - thin / 2.0, z), "seat_slat"))
        rails = [
            box(
                (0.03, max(t - thin, 0.02) + 0.004, d),
                (s * (w / 2.0 - 0.04), seat.top - thin - max(t - thin, 0.02) / 2.0 + 0.002, 0.0),
                "seat_frame",
            )
            for s in (-1.0, 1.0)
        ]
        return [*boards, *rails]
    # "bent": hollow across its width over a flat underside.
    sag = between(rng, 0.25, 0.6) * min(t, 0.05)
    rings = []
    for x in np.linspace(-w / 2.0, w / 2.0, 9):
        y = seat.top - sag * (1.0 - (2.0 * x / w) ** 2)
        rings.append([[x, seat.bottom, -d / 2], [x, seat.bottom, d / 2], [x, y, d / 2], [x, y, -d / 2]])
    return [loft(np.array(rings), "seat")]


def random_bend(
    rng: np.random.Generator, width: float, height: float, lean: tuple[float, float] = (0.0, 16.0), bow: float = 0.05
) -> Bend:
    """Draw a shape of a back of this size; half of them are plain apart from their lean."""
    return Bend(
        width,
        height,
        taper=between(rng, 0.8, 1.15) if happens(rng, 0.5) else 1.0,
        bow=between(rng, 0.0, bow) if happens(rng, 0.5) else 0.0,
        curve=between(rng, -0.03, 0.09) if happens(rng, 0.4) else 0.0,
        arch=between(rng, -0.02, 0.09) if happens(rng, 0.35) else 0.0,
        lean=between(rng, *lean),
    )


def back_parts(
    rng: np.random.Generator, seat: Seat, bend: Bend, style: str, thickness: float | None = None, inset: float = 0.0
) -> tuple[list[Part], float]:
    """Build a back of BACK_STYLES on the seat's rear edge; also return the z of its foot.

    The foot reaches down into the seat; `inset` moves it forward from the rear edge.
    """
    t = between(rng, 0.015, 0.04) if thickness is None else thickness
    foot = -seat.depth / 2.0 + t / 2.0 + inset
    if style in _STIFF:
        bend = replace(bend, bow=0.0, curve=0.0)
    flat = BACK_STYLES[style](rng, bend.width, bend.height, t, min(seat.thickness * 0.8, 0.05))
    return [bend.apply(part).moved((0.0, seat.top, foot)) for part in flat], foot


def some_back(rng: np.random.Generator, styles: tuple[str, ...]) -> str:
    """Draw one of the back styles, or any of them when `styles` is empty."""
    return pick(rng, styles or tuple(BACK_STYLES))
