"""Joints of a model's parts: how firmly they hold at contacts, and the ends that are flush with or inside of others."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from kpred.ops.typing import Bool, Float, Int
from kpred.refinement.structure_config import StructureConfig
from kpred.shapes.structure import Structure

ACROSS = 0.03
"""Parts that overlap by less than this along an axis touch across it, unit box."""

FLUSH = 0.01
"""Parts that touch are flush where their ends are within this of each other, unit box."""

SMALL = 0.3
"""Parts with no side longer than this do not slide along what they touch, unit box."""

MIN_LEAN = 0.02
"""A part leans if its slope along an axis is larger than this, as a product of direction cosines."""


@dataclass(frozen=True, eq=False)
class InnerEnds:
    """Ends of parts that are flush with an end of a part they touch, or inside of it.

    Attributes:
        axis: (F,); inside: (F,) step from the touched part's end to this one in the model, 0 if they are flush;
            column: (F, 4) unknowns; factor: (F, 4) of each: by their sum the step changes. The second factor is the
            side, -1 or 1, that the ends are on.
    """

    axis: Int[np.ndarray, " pairs"]
    inside: Float[np.ndarray, " pairs"]
    column: Int[np.ndarray, "pairs 4"]
    factor: Float[np.ndarray, "pairs 4"]


def inner_ends(
    structure: Structure,
    middle: Float[np.ndarray, "parts 3"],
    half: Float[np.ndarray, "parts 3"],
    sign: Float[np.ndarray, " parts"],
    move: Int[np.ndarray, " parts"],
) -> InnerEnds:
    """List flush ends, and ends of parts that lie within a part they touch, along each axis.

    Args:
        middle, half: of the parts' boxes along the axes, unit box; sign: of each part's motion along x; move: number of
            the unknown that moves each part, followed by that of its growth.

    The spline moves both ends of a pair alike, so the parts' own unknowns decide.
    """
    pairs = structure.contact_parts[::2]
    first, second = np.concatenate([pairs, pairs[:, ::-1]]).T
    ends = np.stack([middle - half, middle + half], axis=2)
    step = ends[first] - ends[second]
    is_flush = np.abs(step) < FLUSH
    contained = (step[:, :, 0] > -FLUSH) & (step[:, :, 1] < FLUSH)
    # A flush pair is listed once.
    listed = np.where(is_flush, (first < second)[:, None, None], contained[:, :, None])
    axis, pair, side = np.nonzero(listed.transpose(1, 0, 2))
    one, other, outward = first[pair], second[pair], 2.0 * side - 1.0
    direction = np.where((axis == 0)[:, None], sign[np.stack([one, other], axis=1)], 1.0)
    return InnerEnds(
        axis.astype(np.int64),
        np.where(is_flush, 0.0, step)[pair, axis, side],
        np.stack([move[one], move[one] + 1, move[other], move[other] + 1], axis=1).astype(np.int64),
        np.stack([direction[:, 0], outward, -direction[:, 1], -outward], axis=1),
    )


def contact_weights(structure: Structure, config: StructureConfig) -> Float[np.ndarray, "contacts 3"]:
    """Weigh each contact point's gap along each axis: large across the contact, small along it."""
    return np.repeat(np.where(_across(structure), config.contact, config.sliding), 2, axis=0)


def joint_weights(
    structure: Structure,
    half: Float[np.ndarray, "parts 3"],
    lean_axis: Int[np.ndarray, "parts 3"],
    config: StructureConfig,
) -> Float[np.ndarray, "contacts 3"]:
    """Weigh the gap in the middle of each contact along each axis, for parts that are pinned there; 0 for others.

    Small parts and parts that both lean are pinned: a caster stays on its leg, and the bars of a leaning back stay in
    its frame. They may still turn about the pin.
    """
    small = 2 * half.max(axis=1) < SMALL
    lean = leaning(structure, lean_axis)
    first, second = structure.contact_parts[::2].T
    pinned = (small[first] | small[second])[:, None] | (lean[first] & lean[second])
    return np.where(pinned & ~_across(structure), config.joint, 0.0)


def _across(structure: Structure) -> Bool[np.ndarray, "contacts 3"]:
    """Mark axes across which two parts touch: those along which their contact is thin."""
    side = np.abs(structure.contact_points[1::2] - structure.contact_points[::2])
    found: np.ndarray = (side <= side.min(axis=1, keepdims=True) + 1e-9) | (side < ACROSS)
    return found


def leaning(structure: Structure, lean_axis: Int[np.ndarray, "parts 3"]) -> Bool[np.ndarray, "parts 3"]:
    """Mark parts that already lean along x, y and z as they go along `lean_axis`."""
    other = np.take_along_axis(structure.axes, np.repeat(lean_axis[:, None], 3, axis=1), axis=2)
    found: np.ndarray = np.abs(structure.axes * other).max(axis=1) > MIN_LEAN
    return found
