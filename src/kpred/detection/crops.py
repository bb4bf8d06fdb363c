"""Inputs of the proposal network: points of a proposal and around it, in metres, turned along its longest side."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from kpred.detection.links import Links
from kpred.detection.networks import CHANNELS, FACTS
from kpred.ops.typing import Bool, Float, Int

OWN_POINTS, AROUND_POINTS = 160, 80
SAMPLE = 600
"""Voxels by which the extent of a proposal is measured."""

MARGIN = 0.3
"""Metres about a proposal's box in which points around it are taken."""

CONTEXT = 16_000
"""Voxels of the room from which points around proposals are drawn."""

ANGLES = np.radians(np.arange(0.0, 90.0, 5.0))
"""Yaws that are tried for the sides of a proposal."""

EDGE = 0.02
"""Fraction of the points beyond each end of a side."""

FILL_CELL = 0.08
"""Metres: cells in plan of which a proposal's points fill a part."""


@dataclass(frozen=True, eq=False)
class RoomVoxels:
    """The voxels of an upright room in metres, z up, floor at 0.

    Attributes:
        points, normals: (V, 3); structure: (V,) floor, walls, ceiling.
        segment: (V,) piece of each voxel; -1 for structure.
        cell: edge of a voxel.
    """

    points: Float[np.ndarray, "voxels 3"]
    normals: Float[np.ndarray, "voxels 3"]
    structure: Bool[np.ndarray, " voxels"]
    segment: Int[np.ndarray, " voxels"]
    cell: float


def proposal_crops(
    room: RoomVoxels, links: Links, proposals: Sequence[frozenset[int]], seed: int = 0
) -> tuple[Float[np.ndarray, "proposals points channels"], Float[np.ndarray, "proposals facts"]]:
    """Sample points of every proposal and around it, (P, points, CHANNELS), and describe it as a whole, (P, FACTS)."""
    rng = np.random.default_rng(seed)
    order = np.argsort(room.segment, kind="stable")
    starts = np.searchsorted(room.segment[order], np.arange(int(room.segment.max(initial=-1)) + 2))
    context = rng.permutation(len(room.points))[:CONTEXT]
    context = context[np.argsort(room.points[context, 0], kind="stable")]
    places, segment = room.points[context], room.segment[context]
    clouds = np.zeros((len(proposals), OWN_POINTS + AROUND_POINTS, CHANNELS), dtype=np.float32)
    facts = np.zeros((len(proposals), FACTS), dtype=np.float32)
    member = np.zeros(len(starts), dtype=bool)
    for row, pieces in enumerate(proposals):
        count, own = _drawn(order, starts, sorted(pieces), rng)
        low, high = room.points[own].min(axis=0), room.points[own].max(axis=0)
        chosen = own[:OWN_POINTS]
        member[:] = False
        member[list(pieces)] = True
        first, last = np.searchsorted(places[:, 0], [low[0] - MARGIN, high[0] + MARGIN])
        near = (places[first:last, 1:] > low[1:] - MARGIN).all(axis=1) & (
            places[first:last, 1:] < high[1:] + MARGIN
        ).all(axis=1)
        near &= ~member[segment[first:last]] | (segment[first:last] < 0)
        around = context[first:last][near]
        turn, middle, size = plan_frame(room.points[chosen, :2])
        affinity, touched = links.affinity(pieces)
        frame = turn, middle, float(low[2]), float(high[2])
        clouds[row, :OWN_POINTS] = _channels(room, chosen, frame, affinity, 1.0)
        if len(around):
            drawn = around[rng.integers(0, len(around), AROUND_POINTS)]
            clouds[row, OWN_POINTS:] = _channels(room, drawn, frame, affinity, 0.0)
        area, box = count * room.cell**2, max(float(size[0] * size[1]), 0.01)
        cells = len(np.unique(np.floor(room.points[own, :2] / FILL_CELL).astype(np.int64) @ [1 << 20, 1]))
        facts[row] = [
            *(np.log(area / 4e-4) / 5 - 1, size[0], size[1], low[2], high[2]),
            *(np.log(area / box), cells * FILL_CELL**2 / box - 1.0),
            *_bonds(affinity, touched, member[: len(affinity)]),
        ]
    return clouds, facts


def _drawn(
    order: np.ndarray, starts: np.ndarray, pieces: Sequence[int], rng: np.random.Generator
) -> tuple[int, np.ndarray]:
    """Return the number of a proposal's voxels, and `SAMPLE` of them at random, with repeats."""
    ends = np.cumsum([starts[piece + 1] - starts[piece] for piece in pieces])
    drawn = rng.integers(0, int(ends[-1]), SAMPLE)
    which = np.searchsorted(ends, drawn, side="right")
    return int(ends[-1]), order[drawn - ends[which] + starts[np.asarray(pieces) + 1][which]]


def plan_frame(plan: Float[np.ndarray, "points 2"]) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Find the smallest upright box of points in plan: rotation (2, 2) into it, its middle (2,) and sides (2,).

    The longer side comes first; the middle is in the frame of the points.
    """
    cosine, sine = np.cos(ANGLES), np.sin(ANGLES)
    turns = np.stack([np.stack([cosine, sine], axis=1), np.stack([-sine, cosine], axis=1)], axis=1)
    turned = np.sort(turns @ plan.T, axis=2)
    edge = int(EDGE * len(plan))
    low, high = turned[:, :, edge], turned[:, :, len(plan) - 1 - edge]
    best = int(np.argmin((high - low + 0.02).prod(axis=1)))
    turn, size = turns[best], (high - low)[best]
    middle = turn.T @ ((low + high)[best] / 2)
    if size[1] > size[0]:
        turn, size = np.array([[0.0, 1.0], [-1.0, 0.0]]) @ turn, size[::-1]
    return turn, middle, size


def _bonds(affinity: np.ndarray, touched: np.ndarray, member: np.ndarray) -> tuple[float, float, float]:
    """Return the mean affinity within a proposal, that to what it touches, and the largest one to that."""
    inner, outer = touched * member, touched * ~member
    mean = [float((affinity * weight).sum() / max(float(weight.sum()), 1e-9)) for weight in (inner, outer)]
    beside = outer > 0
    return mean[0], mean[1], float(affinity[beside].max(initial=-1.0))


def _channels(
    room: RoomVoxels,
    rows: np.ndarray,
    frame: tuple[np.ndarray, np.ndarray, float, float],
    affinity: np.ndarray,
    own: float,
) -> np.ndarray:
    turn, middle, low, high = frame
    height = room.points[rows, 2]
    level = (height - low) / max(high - low, 0.02) - 0.5
    plan = (room.points[rows, :2] - middle) @ turn.T
    flat = room.normals[rows, :2] @ turn.T
    # A normal has no sign: its direction in plan is given by twice its angle.
    facing = [flat[:, 0] ** 2 - flat[:, 1] ** 2, 2 * flat[:, 0] * flat[:, 1]]
    flags = np.full(len(rows), own), room.structure[rows].astype(np.float64)
    bond = np.where(room.segment[rows] >= 0, affinity[room.segment[rows]], 0.0)
    upright = room.normals[rows, 2] ** 2
    return np.column_stack([plan, height, *flags, upright, level.clip(-2.0, 2.0), *facing, bond])


def turned_clouds(
    clouds: Float[np.ndarray, "batch points channels"], quarters: int
) -> Float[np.ndarray, "batch points channels"]:
    """Return clouds turned by quarter turns about the up axis."""
    result = clouds.copy()
    for _ in range(quarters % 4):
        result[:, :, 0], result[:, :, 1] = -result[:, :, 1], result[:, :, 0].copy()
        result[:, :, 7:9] *= -1.0
    return result
