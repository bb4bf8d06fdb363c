"""Units of length of scans: named, or guessed by how large furniture is."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Literal

import numpy as np

from kpred.ops.typing import Float
from kpred.shapes.furniture_size import usual_range
from kpred.shapes.unit_name import UnitName

METRES: dict[UnitName, float] = {"m": 1.0, "cm": 0.01, "mm": 0.001, "in": 0.0254, "ft": 0.3048}
"""Length of each unit in metres."""

GUESSED: tuple[UnitName, ...] = ("m", "cm", "mm")
"""Units that are guessed; inches and feet must be named."""


@dataclass(frozen=True)
class LengthUnit:
    """A unit of length.

    Attributes:
        name: m, cm, mm, in or ft.
        origin: `given` by the caller, `guessed` from the object's size, or `assumed` where no unit is plausible.
    """

    name: UnitName
    origin: Literal["given", "guessed", "assumed"]

    @property
    def metres(self) -> float:
        """Its length in metres."""
        return METRES[self.name]


def guess_unit(size: Float[np.ndarray, "3"], category: str) -> LengthUnit:
    """Guess the unit in which an object of this category and size (3,) is about as large as such furniture is."""
    low, high = usual_range(category)
    middle = math.sqrt(low * high)
    longest = max(float(np.max(size)), 1e-12)
    best = min(GUESSED, key=lambda name: abs(math.log(longest * METRES[name] / middle)))
    if low <= longest * METRES[best] <= high:
        return LengthUnit(best, "guessed")
    return LengthUnit("m", "assumed")
