"""Chairs whose seat and back are bent from one sheet or moulded as one bowl."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from kpred.synthetic.chair.bases import pedestal_base, sled_base, star_base, tulip_base
from kpred.synthetic.chair.legs import corner_legs, leg_parts
from kpred.synthetic.chair.seats import Seat, seat_size
from kpred.synthetic.chance import between, happens, pick
from kpred.synthetic.parts import Part, box, ellipse, loft, slab
from kpred.synthetic.paths import rounded_path

Family = Callable[[np.random.Generator], list[Part]]
_RINGS = 20


def shell(
    rng: np.random.Generator,
    seat: Seat,
    rise: float,
    lean: float,
    thickness: float,
    hollow: float,
    wrap: float = 0.0,
) -> list[Part]:
    """Build a seat and back bent from one sheet.

    `hollow`: depth of its dish in metres, `wrap`: how far its sides rise as arms, `lean` of the back in degrees.
    """
    d = seat.depth
    path = rounded_path(
        [
            (0.0, seat.top - between(rng, 0.0, 0.03), d / 2.0),
            (0.0, seat.top, d / 2.0 - 0.06),
            (0.0, seat.top - 0.015, -d / 2.0),
            (0.0, seat.top + rise, -d / 2.0 - rise * np.tan(np.radians(lean))),
        ],
        between(rng, 0.06, 0.2),
        6,
    )
    travel = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(path, axis=0), axis=1))])
    t = np.linspace(0.0, 1.0, _RINGS)
    line = np.column_stack([np.interp(t * travel[-1], travel, path[:, k]) for k in (2, 1)])
    steps = np.gradient(line, axis=0)
    steps /= np.linalg.norm(steps, axis=1, keepdims=True)
    # The path runs to the back, so a quarter turn gives the sitter's side: up over the seat, forward of the back.
    normals = np.column_stack([steps[:, 1], -steps[:, 0]])
    front, waist, crown = between(rng, 0.8, 1.0), between(rng, 0.85, 1.05), between(rng, 0.5, 1.0)
    widths = seat.width / 2.0 * np.interp(t, [0.0, 0.2, 0.5, 0.75, 1.0], [front, 1.0, waist, waist * 0.97, crown])
    if happens(rng, 0.6):
        # Round the free ends off.
        widths *= np.interp(t, [0.0, 0.05, 0.1, 0.88, 0.95, 1.0], [0.75, 0.94, 1.0, 1.0, 0.9, 0.62])
    middle = between(rng, 0.42, 0.55)
    lift = wrap * np.exp(-(((t - middle) / between(rng, 0.18, 0.28)) ** 2))
    # The sides rise along directions that turn evenly from up to forward: true normals would cross in the bend.
    turn = np.radians(np.clip((t - 0.25) / 0.5, 0.0, 1.0) * 55.0)
    rising = np.column_stack([np.sin(turn), np.cos(turn)])
    across = np.linspace(-1.0, 1.0, 13)
    rings = []
    for k in range(_RINGS):
        bow = across[:, None] ** 2 * normals[k] * hollow + np.abs(across[:, None]) ** 5 * rising[k] * lift[k]
        upper = line[k] + bow
        half = widths[k] * (1.0 - 0.15 * np.abs(across) ** 5 * lift[k] / 0.25)
        # Under the rising sides the sheet's thickness lies across, elsewhere along the normal.
        inner = 1.0 - thickness / widths[k] * np.minimum(1.0, lift[k] / 0.1)
        lower = upper - normals[k] * thickness
        outer = np.column_stack([across * half, lower[:, 1], lower[:, 0]])
        rings.append(np.concatenate([np.column_stack([across * half * inner, upper[:, 1], upper[:, 0]]), outer[::-1]]))
    last = len(across) - 1
    quads = [
        quad for i in range(last) for quad in ([i, i + 1, 2 * last + 1 - i], [i + 1, 2 * last - i, 2 * last + 1 - i])
    ]
    # Rings begin in the middle of the sheet, whose line separates the runs of seat and back.
    middle_first = np.roll(np.stack(rings), -(last // 2), axis=1)
    cap = (np.array(quads) - last // 2) % (2 * last + 2)
    return [loft(middle_first, "shell", cap)]


def _bent_shell(
    rng: np.random.Generator, seat: Seat, rise: tuple[float, float], thickness: tuple[float, float], wrap: float
) -> list[Part]:
    """Build a shell with rise and thickness within the given ranges, leaning and hollow by chance."""
    height, lean = between(rng, *rise), between(rng, 4.0, 22.0)
    thick, hollow = between(rng, *thickness), between(rng, 0.0, 0.04)
    return shell(rng, seat, height, lean, thick, hollow, wrap)


def shell_legs(rng: np.random.Generator) -> list[Part]:
    """Build a bent shell on four splayed legs."""
    seat = seat_size(rng, (0.42, 0.56), (0.38, 0.47), (0.03, 0.04))
    wrap = between(rng, 0.1, 0.22) if happens(rng, 0.4) else 0.0
    parts = _bent_shell(rng, seat, (0.3, 0.55), (0.01, 0.03), wrap)
    under = seat.top - 0.075
    legs = corner_legs(
        rng, seat.width * 0.72, seat.depth * 0.75, under, between(rng, 0.02, 0.035), between(rng, 0.03, 0.09)
    )
    frame = box((seat.width * 0.72, 0.07, seat.depth * 0.7), (0.0, under + 0.028, 0.0), "seat_frame")
    return [*parts, frame, *leg_parts(rng, legs, pick(rng, ("round", "cone", "square", "tapered")))]


def shell_base(rng: np.random.Generator) -> list[Part]:
    """Build a bent shell on a pedestal, a swivel star, or runners."""
    seat = seat_size(rng, (0.42, 0.6), (0.38, 0.48), (0.03, 0.04))
    wrap = between(rng, 0.1, 0.25) if happens(rng, 0.5) else 0.0
    parts = _bent_shell(rng, seat, (0.3, 0.6), (0.012, 0.035), wrap)
    kind = pick(rng, ("pedestal", "star", "sled"))
    plate = box((seat.width * 0.4, 0.06, seat.depth * 0.45), (0.0, seat.top - 0.045, 0.0), "seat_frame")
    if kind == "pedestal":
        return [*parts, plate, *pedestal_base(rng, seat.top - 0.05, seat.width)]
    if kind == "star":
        return [*parts, plate, *star_base(rng, seat.top - 0.05, between(rng, 0.24, 0.33), happens(rng, 0.6))]
    wide = box((seat.width * 0.8, 0.06, seat.depth * 0.7), (0.0, seat.top - 0.045, 0.0), "seat_frame")
    return [*parts, wide, *sled_base(rng, seat.width * 0.82, seat.depth * 0.85, seat.top - 0.06)]


def tulip(rng: np.random.Generator) -> list[Part]:
    """Build a moulded shell on a flowing stem."""
    seat = seat_size(rng, (0.45, 0.6), (0.4, 0.47), (0.03, 0.05))
    parts = shell(
        rng,
        seat,
        between(rng, 0.3, 0.5),
        between(rng, 6.0, 20.0),
        between(rng, 0.015, 0.04),
        between(rng, 0.01, 0.04),
        between(rng, 0.12, 0.26),
    )
    pad = slab(
        ellipse(seat.width * 0.75, seat.depth * 0.7, 18), seat.top - 0.02, between(rng, 0.03, 0.06), "seat_cushion"
    )
    return [*parts, pad, *tulip_base(rng, seat.top - 0.01, between(rng, 0.2, 0.3))]


SHELL_FAMILIES: dict[str, Family] = {
    "shell_legs": shell_legs,
    "shell_base": shell_base,
    "tulip": tulip,
}
