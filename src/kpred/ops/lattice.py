"""Free-form deformation: a box-shaped cage of control points around a shape (Sederberg and Parry 1986).

The control points are those of a uniform quadratic B-spline over a box, `SIZE` along each axis. Their weights sum to 1
and reproduce affine maps, as a cage's mean value coordinates do, but need no mesh around the shape, have a closed form,
and follow the axes that furniture is built along.
"""

from __future__ import annotations

from functools import lru_cache

import torch
from torch import Tensor

from kpred.ops.typing import Float

SIZE = 5
"""Control points along each axis."""

BEND, STRETCH, TWIST = 10.0, 0.1, 30.0
"""Stiffness against bending what is straight, against stretching along an axis unevenly, and against twisting."""

SPACING = (SIZE / 4) ** 4
"""Makes second differences those of a lattice of 4, so that a finer one is as stiff."""


def lattice_weights(
    points: Float[Tensor, "points 3"], low: Float[Tensor, "3"], high: Float[Tensor, "3"]
) -> Float[Tensor, "points controls"]:
    """Weights of the SIZE^3 control points (x slowest) of the lattice over the box from `low` to `high`, one frame.

    A warped point is p + weights @ displacement of the control points. Outside the box the outermost polynomials go on.
    """
    cells = SIZE - 2
    place = (points - low) / (high - low).clamp(min=1e-3) * cells
    cell = place.floor().clamp(0, cells - 1)
    f = place - cell
    pieces = torch.stack([(1 - f).square() / 2, 0.5 + f - f.square(), f.square() / 2], dim=-1)
    along = pieces.new_zeros(*points.shape, SIZE)
    along.scatter_(-1, cell.long()[..., None] + torch.arange(3, device=points.device), pieces)
    x, y, z = along.unbind(1)
    return (x[:, :, None, None] * y[:, None, :, None] * z[:, None, None, :]).flatten(1)


@lru_cache(maxsize=1)
def lattice_stiffness() -> Float[Tensor, "3 controls controls"]:
    """Quadratic forms of the displacements along x, y and z; float64, zero exactly for affine maps.

    Second differences along the lattice's axes. Uneven stretch along an axis costs least, since legs grow without the
    seat; straight edges and flat boards stay so.
    """
    first, second, one = _differences(1), _differences(2), torch.eye(SIZE, dtype=torch.float64)
    forms = []
    for moved in range(3):
        form = torch.zeros(SIZE**3, SIZE**3, dtype=torch.float64)
        for axis in range(3):
            row = _kron([second if at == axis else one for at in range(3)])
            form += (STRETCH if axis == moved else BEND) * row.T @ row
            row = _kron([one if at == axis else first for at in range(3)])
            form += TWIST * row.T @ row
        forms.append(SPACING * form)
    return torch.stack(forms)


@lru_cache(maxsize=1)
def lattice_asymmetry() -> Float[Tensor, "3 controls controls"]:
    """Quadratic forms of what is not mirror symmetric about the box's middle plane across x; float64.

    Displacements along x are symmetric if they are opposite on both sides, those along y and z if they are equal.
    """
    one = torch.eye(SIZE**3, dtype=torch.float64)
    mirror = one[torch.arange(SIZE**3).view(SIZE, SIZE, SIZE).flip(0).flatten()]
    odd, even = (one - mirror) / 2, (one + mirror) / 2
    return torch.stack([even.T @ even, odd.T @ odd, odd.T @ odd])


def _differences(order: int) -> Tensor:
    rows = torch.eye(SIZE, dtype=torch.float64)
    for _ in range(order):
        rows = rows[1:] - rows[:-1]
    return rows


def _kron(parts: list[Tensor]) -> Tensor:
    return torch.kron(torch.kron(parts[0], parts[1]), parts[2])
