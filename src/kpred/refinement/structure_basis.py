"""The family of maps that keep a model CAD, as columns: linear in its unknowns, one small system an axis.

Along each axis a point v of part c moves by f(v) + t_c + s_c (v - m_c) / h_c + l_c q + b_c (q^2 - 1/3): f is a
quadratic B-spline over the source's box, the same for all parts; t_c and s_c move and grow the part's own box (middle
m_c, half side h_c). With q = (w - m_c) / h_c along another axis w, l_c leans the part, of which the map makes a
rotation, and b_c bends it, if it is curved already. Where a part is oblique or curved, f is replaced by its chord
(`Structure.affine_ranges`), so that planar facets stay planar. Parts that mirror each other have the same unknowns, and
of a symmetric model f is odd about the mirror plane.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from kpred.ops.typing import Float, Int
from kpred.refinement.joints import InnerEnds, contact_weights, inner_ends, joint_weights
from kpred.refinement.structure_columns_cpu import fill_chords, fill_own, fill_spline
from kpred.refinement.structure_config import StructureConfig
from kpred.shapes.structure import Structure
from kpred.shapes.structure.repeats import repeated_parts, repeated_thicknesses

KINDS = 4
"""Unknowns of each group along an axis: move, grow, lean, bend."""

MIN_HALF_SIDE = 0.003
"""Least half side by which a part's growth is measured, unit box."""

STANDING = 0.01
"""Parts whose lowest points are within this of the model's lowest stand on the floor, unit box."""

LEVEL = 10.0
"""Weight that keeps what stands on the floor level."""

UNIT_SIDE = 2.0
"""Longest side of a model in its unit box."""

RIGID = 1e3
"""Weight of what must hold exactly: far above that of the scan, which is about 1."""


@dataclass(frozen=True, eq=False)
class StructureBasis:
    """Columns of one model of C parts in G groups, U = K + 4 G unknowns an axis.

    Attributes:
        structure: of the model.
        low, high: (3,) range of the spline along each axis.
        middle, half: (C, 3) of each part's box along the world's axes.
        group: (C,) unknowns that each part uses; sign: (C,) -1 for parts that mirror another's motion along x.
        stiff: (3, U, U) quadratic form of smoothness, contacts and symmetry, float64.
        ends: of parts that are flush with what they touch, or inside of it.
        growth: (C, 3, U) growth of each part's sides, by the unknowns.
        lean_axis: (C, 3) the axis w along which each part leans and bends in x, y and z.
        controls: K.
    """

    structure: Structure
    low: np.ndarray
    high: np.ndarray
    middle: np.ndarray
    half: np.ndarray
    group: np.ndarray
    sign: np.ndarray
    stiff: np.ndarray
    ends: InnerEnds
    growth: np.ndarray
    lean_axis: np.ndarray
    controls: int

    @property
    def standing(self) -> np.ndarray:
        """Whether each part (C,) stands on the floor."""
        lowest = (self.middle - self.half)[:, 1]
        return lowest < lowest.min() + STANDING

    @property
    def unknowns(self) -> int:
        """Unknowns along each axis."""
        return self.stiff.shape[1]

    def columns(
        self, points: Float[np.ndarray, "points 3"], parts: Int[np.ndarray, " points"]
    ) -> tuple[Float[np.ndarray, "3 controls points"], Float[np.ndarray, "3 kinds points"]]:
        """Compute the columns of f, and those of t, s, l and b, for points of the given parts; float32."""
        spline = np.empty((3, self.controls, len(points)), np.float32)
        boxes = (self.middle, self.half, np.ascontiguousarray(self.structure.ends_only))
        place, of = np.ascontiguousarray(points, dtype=np.float64), np.asarray(parts, np.int64)
        fill_chords(place, of, self.low, self.high, *boxes, self._ranges, spline)
        return spline, self._own(place, of)

    @property
    def _ranges(self) -> np.ndarray:
        """Affine ranges (R, 4) of parts along axes."""
        return np.ascontiguousarray(np.asarray(self.structure.affine_ranges, np.float64).reshape(-1, 4))

    def _own(self, points: np.ndarray, parts: np.ndarray) -> np.ndarray:
        """Compute the columns (3, KINDS, N) of the parts' own unknowns."""
        own = np.empty((3, KINDS, len(points)), np.float32)
        fill_own(points, parts, self.middle, self.half, self.sign, self.lean_axis, own)
        return own

    def rows(
        self, points: Float[np.ndarray, "points 3"], parts: Int[np.ndarray, " points"]
    ) -> Float[np.ndarray, "3 points unknowns"]:
        """Compute the same columns as dense rows over all unknowns, float64.

        Where a part follows f at its ends alone, here it follows f itself: parts may slide along one another as f takes
        them.
        """
        place, of = np.ascontiguousarray(points, dtype=np.float64), np.asarray(parts, np.int64)
        own, spline = self._own(place, of), np.empty((3, len(place), self.controls))
        fill_spline(place, of, self.low, self.high, self._ranges, spline)
        found = np.zeros((3, len(place), self.controls + KINDS * (int(self.group.max()) + 1)))
        found[:, :, : self.controls] = spline
        index = np.arange(len(place))
        for kind in range(KINDS):
            found[:, index, self.controls + KINDS * self.group[of] + kind] = own[:, kind]
        return found


def structure_basis(structure: Structure, config: StructureConfig) -> StructureBasis:
    """Set up the columns and the stiffness of one model; its structure is in the unit box."""
    corners = _world_boxes(structure)
    # Arrays of all models have one layout in memory: compiled code exists once for each layout.
    middle = np.ascontiguousarray(corners.mean(axis=1))
    half = np.ascontiguousarray(np.maximum(np.diff(corners, axis=1)[:, 0] / 2, MIN_HALF_SIDE))
    low, high = corners[:, 0].min(axis=0), corners[:, 1].max(axis=0)
    if np.isfinite(structure.mirror):
        reach = max(high[0] - structure.mirror, structure.mirror - low[0])
        low[0], high[0] = structure.mirror - reach, structure.mirror + reach
    group, sign = _groups(structure)
    size = config.controls + KINDS * (int(group.max()) + 1)
    lean_axis = np.stack([np.ones(len(half), int), np.where(half[:, 0] > half[:, 2], 0, 2), np.ones(len(half), int)], 1)
    bare = StructureBasis(
        structure, low, high, middle, half, group, sign, np.zeros((3, size, size)),
        inner_ends(structure, middle, half, sign, config.controls + KINDS * group), np.zeros(0), lean_axis,
        config.controls,
    )  # fmt: skip
    parts = np.arange(structure.parts)
    growth = (bare.rows(corners[:, 1], parts) - bare.rows(corners[:, 0], parts)).transpose(1, 0, 2)
    growth[:, :, config.controls + 2 :: KINDS] = 0.0
    tied = replace(bare, growth=np.ascontiguousarray(growth))
    return replace(tied, stiff=_stiffness(tied, config))


def _stiffness(basis: StructureBasis, config: StructureConfig) -> np.ndarray:
    """Build the stiffness (3, U, U)."""
    structure, controls, size = basis.structure, basis.controls, basis.unknowns
    second = np.diff(np.eye(controls), 2, axis=0)
    stiff = np.zeros((3, size, size))
    stiff[:, :controls, :controls] = config.smoothness * second.T @ second + config.ridge * np.eye(controls)
    own = np.arange(controls, size)
    stiff[:, own, own] = config.part_ridge
    for part in range(structure.parts):
        grow = controls + KINDS * basis.group[part] + 1
        stiff[:, grow, grow] += config.growth_ridge / basis.half[part] ** 2
        stiff[:, grow + 2, grow + 2] += config.bend_ridge
    if len(structure.contact_points):
        first, second_part = structure.contact_parts.T
        gap = basis.rows(structure.contact_points, first) - basis.rows(structure.contact_points, second_part)
        weight = contact_weights(structure, config).T
        stiff += gap.transpose(0, 2, 1) @ (weight[:, :, None] * gap)
        middle = (gap[:, ::2] + gap[:, 1::2]) / 2
        pin = joint_weights(structure, basis.half, basis.lean_axis, config).T
        stiff += middle.transpose(0, 2, 1) @ (pin[:, :, None] * middle)
    _tie_repeats(basis, config, stiff)
    feet = np.flatnonzero(basis.standing)
    if len(feet) > 1:
        soles = basis.rows((basis.middle - basis.half)[feet], feet)[1]
        soles[:, controls + 2 :: KINDS] = soles[:, controls + 3 :: KINDS] = 0.0
        level = soles[1:] - soles[:1]
        stiff[1] += LEVEL * level.T @ level
    if np.isfinite(structure.mirror):
        # Odd up to a shift of everything: alpha_k + alpha_(K-1-k) is the same for all k.
        even = np.zeros((controls // 2, size))
        for k in range(controls // 2):
            even[k, [k, controls - 1 - k]] = 1.0
        difference = np.diff(even, axis=0)
        stiff[0] += RIGID * difference.T @ difference
        # What is its own mirror image does not move by itself.
        moves = controls + KINDS * basis.group[structure.mirrored_parts == np.arange(structure.parts)]
        stiff[0, moves, moves] += RIGID
    return stiff


def _tie_repeats(basis: StructureBasis, config: StructureConfig, stiff: np.ndarray) -> None:
    """Add to the stiffness (3, U, U) what keeps the thicknesses of parts of one size equal: legs, slats, shelves."""
    sides = 2 * basis.half
    sets = repeated_parts(sides, basis.structure.curved, UNIT_SIDE)
    thin = repeated_thicknesses(sides, sets, UNIT_SIDE)
    for number in np.unique(sets[thin.any(axis=1)]):
        equal = np.flatnonzero(sets == number)
        if len(np.unique(basis.group[equal])) > 1:
            off = basis.growth[equal] - basis.growth[equal].mean(axis=0)
            tied = np.where(thin[equal][:, :, None], off, 0.0)
            stiff += config.repeat * np.einsum("pau,pav->auv", tied, tied)


def _groups(structure: Structure) -> tuple[np.ndarray, np.ndarray]:
    """List the group (C,) of each part and its sign along x; parts that mirror each other are one group."""
    count = structure.parts
    group, sign = np.full(count, -1), np.ones(count)
    following = 0
    for part in range(count):
        if group[part] >= 0:
            continue
        group[part] = following
        other = int(structure.mirrored_parts[part])
        if np.isfinite(structure.mirror) and other > part:
            group[other], sign[other] = following, -1.0
        following += 1
    return group, sign


def _world_boxes(structure: Structure) -> np.ndarray:
    """Compute the corners (C, 2, 3) of the parts' boxes along the world's axes."""
    middle = np.einsum("ckj,ck->cj", structure.axes, structure.boxes.mean(axis=1))
    reach = np.einsum("ckj,ck->cj", np.abs(structure.axes), np.diff(structure.boxes, axis=1)[:, 0] / 2)
    return np.stack([middle - reach, middle + reach], axis=1)
