"""Limits of a structure map: how far its unknowns may be changed before a part folds, or grows or shrinks too far."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from kpred.ops.typing import Float
from kpred.refinement.freedom import growth_limits, spline_slopes, spline_spans
from kpred.refinement.structure_basis import KINDS, StructureBasis

FLATTEST = 0.1
"""Least slope of the map of one part along an axis; 0 would fold it."""

SLACK = 1e-9


@dataclass(frozen=True, eq=False)
class Limits:
    """Linear limits of the unknowns of one model.

    Attributes:
        rows: for each axis, (L, U); low, high: for each axis, (L,), between which their products must stay.
    """

    rows: tuple[np.ndarray, ...]
    low: tuple[np.ndarray, ...]
    high: tuple[np.ndarray, ...]

    @classmethod
    def of(cls, basis: StructureBasis) -> Limits:
        """List the limits of one model."""
        each = [_limits_along(basis, axis) for axis in range(3)]
        return cls(tuple(one[0] for one in each), tuple(one[1] for one in each), tuple(one[2] for one in each))

    def fraction(
        self, solution: Float[np.ndarray, " unknowns"], change: Float[np.ndarray, " unknowns"], axis: int
    ) -> float:
        """Compute the largest fraction, 0 to 1, of a change along one axis that stays within the limits."""
        now, step = self.rows[axis] @ solution, self.rows[axis] @ change
        # What is beyond a limit already may stay there, but go no farther.
        high, low = np.maximum(self.high[axis], now), np.minimum(self.low[axis], now)
        found = 1.0
        for room, rate in ((high - now, step), (now - low, -step)):
            moving = rate > SLACK
            if moving.any():
                found = min(found, float((room[moving] / rate[moving]).min()))
        return max(found, 0.0)


def _limits_along(basis: StructureBasis, axis: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    growth = growth_limits(basis)
    slopes, spans = spline_slopes(basis)[axis], spline_spans(basis)[:, axis]
    rows, low, high = [*basis.growth[:, axis]], [*growth[:, axis, 0]], [*growth[:, axis, 1]]
    for part, (first, last) in enumerate(spans):
        if first < 0:
            continue
        for control in range(first, last):
            step = np.zeros(basis.unknowns)
            step[[control, control + 1]] = -1.0, 1.0
            rows.append(step)
            low.append(slopes[0])
            high.append(slopes[1])
            # The part's own growth acts beside the spline.
            own = step / slopes[2]
            own[basis.controls + KINDS * basis.group[part] + 1] += 1.0 / basis.half[part, axis]
            rows.append(own)
            low.append(FLATTEST - 1.0)
            high.append(np.inf)
    return np.array(rows), np.array(low), np.array(high)
