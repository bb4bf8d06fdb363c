"""Inputs of the proposal network: points of a proposal and around it, in metres, centred in plan."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from kpred.detection.networks import CHANNELS
from kpred.ops.typing import Bool, Float, Int

OWN_POINTS, AROUND_POINTS = 160, 64
MARGIN = 0.3
"""Metres about a proposal's box in which points around it are taken."""

CONTEXT = 16_000
"""Voxels of the room from which points around proposals are drawn."""


@dataclass(frozen=True, eq=False)
class RoomVoxels:
    """The voxels of an upright room in metres, z up, floor at 0.

    Attributes:
        points: (V, 3); vertical: (V,) squared vertical part of their normals; structure: (V,) floor, walls, ceiling.
        segment: (V,) piece of each voxel; -1 for structure.
        cell: edge of a voxel.
    """

    points: Float[np.ndarray, "voxels 3"]
    vertical: Float[np.ndarray, " voxels"]
    structure: Bool[np.ndarray, " voxels"]
    segment: Int[np.ndarray, " voxels"]
    cell: float


def proposal_crops(
    room: RoomVoxels, proposals: Sequence[frozenset[int]], seed: int = 0
) -> tuple[Float[np.ndarray, "proposals points channels"], Float[np.ndarray, " proposals"]]:
    """Sample points of every proposal and around it, (P, points, CHANNELS), and log voxel counts."""
    rng = np.random.default_rng(seed)
    order = np.argsort(room.segment, kind="stable")
    starts = np.searchsorted(room.segment[order], np.arange(int(room.segment.max(initial=-1)) + 2))
    context = rng.permutation(len(room.points))[:CONTEXT]
    clouds = np.zeros((len(proposals), OWN_POINTS + AROUND_POINTS, CHANNELS), dtype=np.float32)
    amount = np.zeros(len(proposals))
    member = np.zeros(len(starts), dtype=bool)
    for row, pieces in enumerate(proposals):
        own = np.concatenate([order[starts[piece] : starts[piece + 1]] for piece in sorted(pieces)])
        amount[row] = np.log(len(own) * (room.cell / 0.02) ** 2)
        low, high = room.points[own].min(axis=0), room.points[own].max(axis=0)
        middle = np.array([*(low + high)[:2] / 2, 0.0])
        chosen = own[rng.integers(0, len(own), OWN_POINTS)] if len(own) < OWN_POINTS else rng.choice(own, OWN_POINTS)
        member[:] = False
        member[list(pieces)] = True
        near = ((room.points[context] > low - MARGIN) & (room.points[context] < high + MARGIN)).all(axis=1)
        near &= ~member[room.segment[context]] | (room.segment[context] < 0)
        around = context[near]
        clouds[row, :OWN_POINTS] = _channels(room, chosen, middle, low[2], high[2], 1.0)
        if len(around):
            drawn = around[rng.integers(0, len(around), AROUND_POINTS)]
            clouds[row, OWN_POINTS:] = _channels(room, drawn, middle, low[2], high[2], 0.0)
    return clouds, amount


def _channels(
    room: RoomVoxels, rows: np.ndarray, middle: np.ndarray, low: float, high: float, own: float
) -> np.ndarray:
    height = room.points[rows, 2]
    level = (height - low) / max(high - low, 0.02) - 0.5
    place = room.points[rows] - middle
    flags = np.full(len(rows), own), room.structure[rows].astype(np.float64)
    return np.column_stack([place, *flags, room.vertical[rows], level.clip(-2.0, 2.0)])
