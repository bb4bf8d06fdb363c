"""How the pieces of a room hang together: the odds that each is of one object with a set of others."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np
from scipy.sparse import csr_matrix

from kpred.ops.typing import Float, Int

SOFTNESS = 3.0
"""Log-odds that are an affinity of tanh(1)."""


class Links:
    """Affinities between pieces, each pair weighed by how much it touches.

    Args:
        count: number of pieces; pairs: (E, 2) pieces that touch.
        odds: (E,) log-odds that they are of one object; contact: (E, 5) how they touch (`adjacency.touching`).
    """

    def __init__(
        self,
        count: int,
        pairs: Int[np.ndarray, "pairs 2"],
        odds: Float[np.ndarray, " pairs"],
        contact: Float[np.ndarray, "pairs 5"],
    ) -> None:
        amount = np.expm1(contact[:, 0]).clip(min=1.0) if len(pairs) else np.zeros(0)
        rows, columns = np.concatenate([pairs, pairs[:, ::-1]]).T
        shape = (count, count)
        self._odds = csr_matrix((np.tile(odds * amount, 2), (rows, columns)), shape=shape)
        self._amount = csr_matrix((np.tile(amount, 2), (rows, columns)), shape=shape)

    def affinity(self, members: Iterable[int]) -> tuple[Float[np.ndarray, " pieces"], Float[np.ndarray, " pieces"]]:
        """Return the affinity of every piece to a set, in [-1, 1], 0 where they do not touch, and how much they touch.

        A member's affinity is that to the others of the set.
        """
        chosen = np.zeros(self._amount.shape[0])
        chosen[list(members)] = 1.0
        amount = self._amount @ chosen
        return np.tanh(self._odds @ chosen / np.maximum(amount, 1e-9) / SOFTNESS), amount
