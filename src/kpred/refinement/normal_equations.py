"""Normal equations of many candidates at once: corrections of keypoints, by what is wanted of the points they move.

A result is guess + B c; its distance to what is wanted is linear in c, with one K x K matrix for x, y and z.
"""

from __future__ import annotations

import torch
from torch import Tensor

from kpred.ops.typing import Float, Int
from kpred.ops.weighted_sums import add_wanted, weighted_products


class NormalEquations:
    """Sums of weighted squares, for C candidates: what is wanted of their points.

    `basis` (C, N, K) moves the points by corrections; `guess` (C, N, 3) are the points without any.
    """

    def __init__(
        self, basis: Float[Tensor, "candidates points keypoints"], guess: Float[Tensor, "candidates points 3"]
    ) -> None:
        self.guess = guess
        self.across = basis.transpose(1, 2).contiguous()
        self.clear()

    def clear(self) -> None:
        """Forget all that is wanted; basis and guess stay."""
        self._wanted = self.guess.new_zeros(*self.guess.shape[:2], 4)
        self._products: Tensor | None = None

    def add_at(
        self,
        index: Int[Tensor, "candidates wanted"],
        wanted: Float[Tensor, "candidates places 3"],
        weight: Float[Tensor, "candidates wanted"],
        picked: Int[Tensor, "candidates wanted"] | None = None,
    ) -> None:
        """Want the points of these indices at all places, or at the picked ones of them."""
        add_wanted(self._wanted, wanted, weight, index, picked)
        self._products = None

    @property
    def normal(self) -> Float[Tensor, "candidates keypoints keypoints"]:
        """Left side of the equations, without priors."""
        return self._all()[..., :-3]

    @property
    def right(self) -> Float[Tensor, "candidates keypoints 3"]:
        """Right side, one column for each of x, y and z."""
        return self._all()[..., -3:]

    def level(self) -> Float[Tensor, " candidates"]:
        """Mean diagonal of the left side."""
        return self.normal.diagonal(dim1=1, dim2=2).mean(1)

    def solve(self, held: Float[Tensor, "candidates keypoints keypoints"]) -> Float[Tensor, "candidates keypoints 3"]:
        """Corrections (C, K, 3) of least squares; `held` is the prior's matrix."""
        found: Tensor = torch.linalg.solve(self.normal + held, self.right)
        return found

    def _all(self) -> Tensor:
        if self._products is None:
            self._products = weighted_products(self.across, self.guess, self._wanted)
        return self._products
