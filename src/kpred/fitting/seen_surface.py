"""Where the surfaces of a scanned room are seen: what shows a surface is empty up to there, and no other solid."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from kpred.ops.solid_cells import CELL
from kpred.ops.typing import Float, Int

DEEP = 2
"""Cells that a surface may lie within a solid: scans and fits are off by as much."""

ABOVE_FLOOR = (2, 4)
"""Cells above a seen floor that are taken to be empty: a camera in the hand looks down at it."""

FLOOR_TOLERANCE = 0.03
"""Metres about the floor's height that are floor."""


class SeenSurface:
    """The cells of a room that hold scanned points, with the object of each.

    Args:
        points: (N, 3) of the scan, metres, y up; rows that are not finite are left out.
        owner: (N,) number of the object that each is of, -1 for none.
        floor: height of the floor; None where there is none.
    """

    def __init__(
        self, points: Float[np.ndarray, "points 3"], owner: Int[np.ndarray, " points"], floor: float | None
    ) -> None:
        finite = np.isfinite(points).all(axis=1)
        places, owners = points[finite], owner[finite]
        cells = np.floor(places / CELL).astype(np.int64)
        if floor is not None:
            on_floor = (np.abs(places[:, 1] - floor) < FLOOR_TOLERANCE) & (owners < 0)
            level = int(np.floor(floor / CELL))
            cells = np.concatenate([cells[~on_floor], *(_at(cells[on_floor], level + up) for up in ABOVE_FLOOR)])
            owners = np.concatenate([owners[~on_floor], *(owners[on_floor] for _ in ABOVE_FLOOR)])
        rows = np.unique(np.column_stack([cells, owners]), axis=0)
        self._cells, self._owner = rows[:, :3], rows[:, 3]

    def around(self, own: int, box: Float[np.ndarray, "2 3"], margin: float) -> Int[np.ndarray, "cells 3"]:
        """List cells (C, 3) in a box (2, 3; metres) and a margin about it that show surface of others than an object.

        Cells that show surface of the object too are left out.
        """
        low, high = np.floor((box[0] - margin) / CELL), np.floor((box[1] + margin) / CELL)
        near = ((self._cells >= low) & (self._cells <= high)).all(axis=1)
        cells, owner = self._cells[near], self._owner[near]
        mine, others = (np.unique(cells[pick], axis=0) for pick in (owner == own, owner != own))
        return others[~np.isin(_codes(others), _codes(mine))]


def deep_cells(cells: Int[np.ndarray, "cells 3"]) -> Int[np.ndarray, "deep 3"]:
    """List the cells of a solid that are `DEEP` cells or more from its surface."""
    codes = _codes(cells)
    inside = np.ones(len(cells), dtype=bool)
    for axis in range(3):
        for side in (-DEEP, DEEP):
            inside &= np.isin(_codes(cells + side * np.eye(3, dtype=np.int64)[axis]), codes)
    return cells[inside]


def owners(count: int, objects: Sequence[np.ndarray]) -> Int[np.ndarray, " points"]:
    """Return the number of the object that holds each of `count` points, -1 for none."""
    result = np.full(count, -1, dtype=np.int64)
    for number, rows in enumerate(objects):
        result[rows[rows >= 0]] = number
    return result


def _at(cells: np.ndarray, height: int) -> np.ndarray:
    return np.column_stack([cells[:, 0], np.full(len(cells), height), cells[:, 2]])


def _codes(cells: np.ndarray) -> np.ndarray:
    """Make one whole number of each cell (C, 3)."""
    offset = np.asarray(cells, dtype=np.int64) + (1 << 19)
    codes: np.ndarray = (offset[:, 0] << 40) | (offset[:, 1] << 20) | offset[:, 2]
    return codes
