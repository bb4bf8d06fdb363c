"""What each part of a model may do: lean, bend, grow within limits; and the box that it does so about."""

from __future__ import annotations

import numpy as np

from kpred.ops.typing import Float, Int
from kpred.refinement.structure_basis import StructureBasis

MIN_GROWTH, MAX_GROWTH = 0.25, 4.0
"""Least and largest factor by which a part's side may shrink or grow."""

SLENDER = 1.5
"""A part leans along an axis if it is so many times longer along it than across."""


def part_boxes(basis: StructureBasis) -> Float[np.ndarray, "parts 13"]:
    """List own axes (longest first), middle, and 1 for parts that do not lie along the axes."""
    structure = basis.structure
    side = structure.boxes[:, 1] - structure.boxes[:, 0]
    order = np.argsort(-side, axis=1, kind="stable")
    found = np.empty((structure.parts, 13))
    found[:, :9] = np.take_along_axis(structure.axes, order[:, :, None], axis=1).reshape(-1, 9)
    found[:, 9:12] = np.einsum("ck,ckj->cj", structure.boxes.mean(axis=1), structure.axes)
    found[:, 12] = oblique(basis)
    return found


def oblique(basis: StructureBasis) -> Int[np.ndarray, " parts"]:
    """Mark parts whose own axes are not the world's."""
    found: np.ndarray = (basis.structure.axes != np.eye(3)).any(axis=(1, 2)).astype(np.int64)
    return found


def possible_leans(basis: StructureBasis) -> Int[np.ndarray, "groups 3"]:
    """List leans of each group in x, y and z: 0 impossible, 1 where the scan shows it, 2 free since it is oblique."""
    structure = basis.structure
    along = np.take_along_axis(basis.half, basis.lean_axis, axis=1)
    each = np.where(along < SLENDER * basis.half, 0, 1 + oblique(basis)[:, None])
    own = _mirrors_itself(basis)
    # What is its own mirror image leans neither to a side nor along one.
    each[own, 0] = 0
    each[own & (basis.lean_axis[:, 1] == 0), 1] = 0
    found = np.zeros((int(basis.group.max()) + 1, 3), np.int64)
    found[basis.group[::-1]] = each[::-1]
    return found


def possible_bends(basis: StructureBasis) -> Int[np.ndarray, "groups 3"]:
    """List bends of each group in x, y and z: 1 for curved parts, unless symmetry forbids it."""
    each = np.repeat(basis.structure.curved.astype(np.int64)[:, None], 3, axis=1)
    each[_mirrors_itself(basis), 0] = 0
    found = np.zeros((int(basis.group.max()) + 1, 3), np.int64)
    found[basis.group[::-1]] = each[::-1]
    return found


def growth_limits(basis: StructureBasis) -> Float[np.ndarray, "parts 3 3"]:
    """List the lowest and highest growth of each part's sides, and their half side; unit box."""
    half = basis.half
    return np.stack([2 * half * (MIN_GROWTH - 1), 2 * half * (MAX_GROWTH - 1), half], axis=2)


def _mirrors_itself(basis: StructureBasis) -> np.ndarray:
    structure = basis.structure
    found: np.ndarray = np.isfinite(structure.mirror) & (structure.mirrored_parts == np.arange(structure.parts))
    return found
