"""Metrics of tables: what is measured of a result, from which surface, in which unit, of how many candidates."""

from __future__ import annotations

from dataclasses import dataclass

UNIT = "unit box squared"
FRAME = "known unit box"

CD = "chamfer_distance"
UCD = "unilateral_chamfer_distance"

SEEN, WHOLE, MESH = "seen", "whole", "mesh"
"""Surfaces: the target's points that a method is given; all of the target; the result's own mesh."""

FRACTION, NO_UNIT = "fraction", "1"


@dataclass(frozen=True)
class Metric:
    """One measure of a result.

    Attributes:
        name: a distance (`CD`, `UCD`), a measure of cleanliness, or of a ranking.
        surface: that it is measured from (`SEEN`, `WHOLE`) or on (`MESH`).
        unit: of the values; `FRACTION` for values that are 0 or 1.
        top_k: retrieved models that are deformed and compared; None where all of the database is.
    """

    name: str
    surface: str = SEEN
    unit: str = UNIT
    top_k: int | None = None

    @property
    def is_error(self) -> bool:
        """Whether the values are distances of results from targets, unit box squared."""
        return self.unit == UNIT
