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
from kpred.refinement.structure_config import StructureConfig
from kpred.shapes.structure import Structure

KINDS = 4
"""Unknowns of each group along an axis: move, grow, lean, bend."""

MIN_HALF_SIDE = 0.003
"""Least half side by which a part's growth is measured, unit box."""

STANDING = 0.01
"""Parts whose lowest points are within this of the model's lowest stand on the floor, unit box."""

LEVEL = 10.0
"""Weight that keeps what stands on the floor level."""

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
        for axis in range(3):
            spline[axis] = self._chords(points[:, axis], parts, axis, self._spline(points[:, axis], parts, axis)).T
        return spline, self._own(points, parts)

    def _own(self, points: np.ndarray, parts: np.ndarray) -> np.ndarray:
        """Compute the columns (3, KINDS, N) of the parts' own unknowns."""
        local = (points - self.middle[parts]) / self.half[parts]
        mirrored = local.copy()
        mirrored[:, 0] *= self.sign[parts]
        own = np.ones((3, KINDS, len(points)), np.float32)
        own[:, 1] = mirrored.T
        along = np.take_along_axis(mirrored, self.lean_axis[parts], axis=1).T
        own[:, 2] = along
        own[:, 3] = along**2 - 1 / 3
        # Along x, parts that mirror each other move against each other.
        own[0] *= self.sign[parts]
        return own

    def rows(
        self, points: Float[np.ndarray, "points 3"], parts: Int[np.ndarray, " points"]
    ) -> Float[np.ndarray, "3 points unknowns"]:
        """Compute the same columns as dense rows over all unknowns, float64.

        Where a part follows f at its ends alone, here it follows f itself: parts may slide along one another as f takes
        them.
        """
        own = self._own(points, parts)
        found = np.zeros((3, len(points), self.controls + KINDS * (int(self.group.max()) + 1)))
        for axis in range(3):
            found[axis, :, : self.controls] = self._spline(points[:, axis], parts, axis)
        index = np.arange(len(points))
        for kind in range(KINDS):
            found[:, index, self.controls + KINDS * self.group[parts] + kind] = own[:, kind]
        return found

    def _spline(self, place: np.ndarray, parts: np.ndarray, axis: int) -> np.ndarray:
        """Compute the weights (N, K) of the controls; between the ends of affine ranges, interpolated."""
        low, high = float(self.low[axis]), float(self.high[axis])
        found = spline_weights(place, low, high, self.controls)
        for part, along, first, last in self.structure.affine_ranges:
            if int(along) != axis:
                continue
            inside = np.flatnonzero((parts == int(part)) & (place >= first) & (place <= last))
            if len(inside) and last > first:
                ends = spline_weights(np.array([first, last]), low, high, self.controls)
                fraction = ((place[inside] - first) / (last - first))[:, None]
                found[inside] = (1 - fraction) * ends[0] + fraction * ends[1]
        return found

    def _chords(self, place: np.ndarray, parts: np.ndarray, axis: int, weights: np.ndarray) -> np.ndarray:
        """Interpolate the weights of parts that have vertices at their ends alone."""
        found, low, high = weights.copy(), self.middle - self.half, self.middle + self.half
        everyone = np.arange(len(self.middle))
        ends = [self._spline(side[:, axis], everyone, axis) for side in (low, high)]
        mine = np.flatnonzero(self.structure.ends_only[parts, axis])
        part = parts[mine]
        fraction = ((place[mine] - low[part, axis]) / (2 * self.half[part, axis]))[:, None]
        found[mine] = (1 - fraction) * ends[0][part] + fraction * ends[1][part]
        return found


def spline_weights(
    place: Float[np.ndarray, " points"], low: float, high: float, controls: int
) -> Float[np.ndarray, "points controls"]:
    """Compute the weights of a uniform quadratic B-spline's controls; outside the range its end pieces go on."""
    cells = controls - 2
    at = (np.asarray(place, dtype=np.float64) - low) / max(high - low, 1e-9) * cells
    cell = np.clip(np.floor(at), 0, cells - 1)
    f = at - cell
    found = np.zeros((len(at), controls))
    rows, first = np.arange(len(at)), cell.astype(int)
    found[rows, first] = (1 - f) ** 2 / 2
    found[rows, first + 1] = 0.5 + f - f**2
    found[rows, first + 2] = f**2 / 2
    return found


def structure_basis(structure: Structure, config: StructureConfig) -> StructureBasis:
    """Set up the columns and the stiffness of one model; its structure is in the unit box."""
    corners = _world_boxes(structure)
    middle, half = corners.mean(axis=1), np.maximum(np.diff(corners, axis=1)[:, 0] / 2, MIN_HALF_SIDE)
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
    stiff = np.stack([_stiffness(bare, axis, config) for axis in range(3)])
    return replace(bare, stiff=stiff, growth=growth)


def _stiffness(basis: StructureBasis, axis: int, config: StructureConfig) -> np.ndarray:
    """Build the stiffness (U, U) of one axis."""
    structure, controls, size = basis.structure, basis.controls, basis.unknowns
    second = np.diff(np.eye(controls), 2, axis=0)
    stiff = np.zeros((size, size))
    stiff[:controls, :controls] = config.smoothness * second.T @ second + config.ridge * np.eye(controls)
    own = np.arange(controls, size)
    stiff[own, own] = config.part_ridge
    for part in range(structure.parts):
        grow = controls + KINDS * basis.group[part] + 1
        stiff[grow, grow] += config.growth_ridge / basis.half[part, axis] ** 2
        stiff[grow + 2, grow + 2] += config.bend_ridge
    if len(structure.contact_points):
        rows = [basis.rows(structure.contact_points, structure.contact_parts[:, side])[axis] for side in (0, 1)]
        gap = rows[0] - rows[1]
        weight = contact_weights(structure, config)[:, axis]
        stiff += gap.T @ (weight[:, None] * gap)
        middle = (gap[::2] + gap[1::2]) / 2
        pin = joint_weights(structure, basis.half, basis.lean_axis, config)[:, axis]
        stiff += middle.T @ (pin[:, None] * middle)
    feet = np.flatnonzero(basis.standing)
    if axis == 1 and len(feet) > 1:
        soles = basis.rows((basis.middle - basis.half)[feet], feet)[1]
        soles[:, controls + 2 :: KINDS] = soles[:, controls + 3 :: KINDS] = 0.0
        level = soles[1:] - soles[:1]
        stiff += LEVEL * level.T @ level
    if axis == 0 and np.isfinite(structure.mirror):
        # Odd up to a shift of everything: alpha_k + alpha_(K-1-k) is the same for all k.
        even = np.zeros((controls // 2, size))
        for k in range(controls // 2):
            even[k, [k, controls - 1 - k]] = 1.0
        difference = np.diff(even, axis=0)
        stiff += RIGID * difference.T @ difference
        # What is its own mirror image does not move by itself.
        moves = controls + KINDS * basis.group[structure.mirrored_parts == np.arange(structure.parts)]
        stiff[moves, moves] += RIGID
    return stiff


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
