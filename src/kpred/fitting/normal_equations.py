"""Normal equations of many candidates at once: keypoint corrections, and scale and shift of the box if asked for.

A result is guess + B c, or s (guess + B c) + t. With u = (s c, t, s - 1) its distance to what is wanted is linear in u:
the columns are B, ones, and, for each axis, that axis' own coordinate of the guess.
"""

from __future__ import annotations

from typing import Literal

import torch
from torch import Tensor

from kpred.ops.typing import Float, Int
from kpred.ops.weighted_sums import add_wanted, weighted_products

LEAST_STRETCH, MOST_STRETCH = -0.5, 1.0
"""Range of scale - 1: a box does not turn inside out."""


def with_box(
    basis: Float[Tensor, "candidates points keypoints"], guess: Float[Tensor, "candidates points 3"]
) -> Float[Tensor, "candidates points columns"]:
    """Columns B, 1, x, y, z: those of the keypoints, of the shift and of the scale of each axis."""
    return torch.cat([basis, torch.ones_like(guess[..., :1]), guess], dim=2)


class NormalEquations:
    """Sums of weighted squares, for C candidates: what is wanted of their points.

    `columns` (C, N, E) are the basis, or `with_box`; `guess` (C, N, 3) the points without any correction.
    """

    def __init__(
        self, columns: Float[Tensor, "candidates points columns"], guess: Float[Tensor, "candidates points 3"]
    ) -> None:
        self.columns, self.guess = columns, guess
        self.across = columns.transpose(1, 2).contiguous()
        self.clear()

    def clear(self) -> None:
        """Nothing is wanted any more; columns and guess stay."""
        self._wanted = self.guess.new_zeros(*self.guess.shape[:2], 4)
        self._products: Tensor | None = None

    def add_at(
        self,
        index: Int[Tensor, "candidates wanted"],
        wanted: Float[Tensor, "candidates places 3"],
        weight: Float[Tensor, "candidates wanted"],
        picked: Int[Tensor, "candidates wanted"] | None = None,
    ) -> None:
        """The points of these indices should be where they are wanted: at all places, or at the picked ones of them."""
        add_wanted(self._wanted, wanted, weight, index, picked)
        self._products = None

    @property
    def normal(self) -> Float[Tensor, "candidates columns columns"]:
        """Left side of the equations, without priors."""
        return self._all()[..., :-3]

    @property
    def right(self) -> Float[Tensor, "candidates columns 3"]:
        """Right side, one column for each of x, y and z."""
        return self._all()[..., -3:]

    def _all(self) -> Tensor:
        if self._products is None:
            self._products = weighted_products(self.across, self.guess, self._wanted)
        return self._products

    def level(self, keypoints: int) -> Float[Tensor, " candidates"]:
        """Mean diagonal of the keypoints' matrix."""
        return self.normal.diagonal(dim1=1, dim2=2)[:, :keypoints].mean(1)

    def solve(
        self,
        held: Float[Tensor, "candidates keypoints keypoints"],
        box: Literal["fixed", "similarity", "per_axis"],
        box_prior: float,
    ) -> tuple[Float[Tensor, "candidates keypoints 3"], Float[Tensor, "candidates 3"], Float[Tensor, "candidates 3"]]:
        """Corrections c, scale s and shift t of least squares; `held` and `box_prior` are the priors' matrices."""
        if box == "fixed":
            correction = torch.linalg.solve(self.normal + held, self.right)
            return correction, torch.ones_like(correction[:, 0]), torch.zeros_like(correction[:, 0])
        # The three axes share all unknowns but the stretch, which is eliminated.
        keypoints = held.shape[1]
        shared = keypoints + 1
        prior = torch.nn.functional.pad(held, (0, 1, 0, 1))
        prior[:, keypoints, keypoints] = box_prior
        cross, own = self.normal[:, :shared, shared:], self.normal[:, shared:, shared:].diagonal(dim1=1, dim2=2)
        solved = torch.linalg.solve(
            self.normal[:, :shared, :shared] + prior, torch.cat([self.right[:, :shared], cross], dim=2)
        )
        rest, along = solved[..., :3], solved[..., 3:]
        pull = self.right[:, shared:].diagonal(dim1=1, dim2=2) - (cross * rest).sum(1)
        stiffness = own + box_prior - (cross * along).sum(1)
        if box == "similarity":
            pull, stiffness = (part.sum(1, keepdim=True).expand(-1, 3) for part in (pull, stiffness))
        stretch = (pull / stiffness).clamp(LEAST_STRETCH, MOST_STRETCH)
        solution = rest - along * stretch[:, None]
        scale = 1.0 + stretch
        return solution[:, :keypoints] / scale[:, None], scale, solution[:, keypoints]
