"""Exact search among very many models: 8-bit codes bound all distances, half-precision tokens settle the few left.

The arrays of a table lie in one file that is mapped into memory (or in memory alone, where no file can be written).
One search reads the codes, about 1.5 kB a model at most, and the half-precision tokens of some hundred models.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from kpred.database.search import (
    Ranking,
    SearchResult,
    TokenIndex,
    as_result,
    checked_query,
    checked_top_k,
    checked_weights,
    exact_distances,
    nearest,
)
from kpred.database.token_codes import Quantiser, bounds
from kpred.ops.typing import Float, UInt8

_FIRST_ROWS = 64


@dataclass(frozen=True)
class TableKey:
    """What a table was made from.

    Attributes:
        category: name; fingerprint: of the weights that made the tokens.
        epoch: changes when a model is removed from the database.
        last_row: greatest row number of the models that are in the table; later ones are not.
    """

    category: str
    fingerprint: str
    epoch: str
    last_row: int


@dataclass(frozen=True, eq=False)
class TokenTable:
    """Tokens of M models in rows of any order.

    Attributes:
        key: see there.
        half: (M, K, C) float16; codes: (G, M, P, S) and errors: (G, M, P) uint8 (`kpred.database.token_codes`).
        id_bytes: all ids in UTF-8, one after the other; id_ends: (M,) where each ends.
        release: lets go of the pages of `half` that a search has read, which would pile up from search to search.
    """

    key: TableKey
    quantiser: Quantiser
    half: Float[np.ndarray, "models keypoints token_size"]
    codes: UInt8[np.ndarray, "groups models planes size"]
    errors: UInt8[np.ndarray, "groups models planes"]
    id_bytes: UInt8[np.ndarray, " bytes"]
    id_ends: np.ndarray
    release: Callable[[], None] | None = None

    def __len__(self) -> int:
        return len(self.half)

    @property
    def model_ids(self) -> tuple[str, ...]:
        """All ids, ascending."""
        return tuple(sorted(self.id_of(row) for row in range(len(self))))

    def id_of(self, row: int) -> str:
        """Return the id of one row."""
        start = int(self.id_ends[row - 1]) if row else 0
        return self.id_bytes[start : int(self.id_ends[row])].tobytes().decode("utf-8")

    def search(self, query: np.ndarray, weights: np.ndarray | None = None, top_k: int = 10) -> SearchResult:
        """Find as `ranked`, as a result."""
        return as_result(self.ranked(query, weights, top_k))

    def ranked(self, query: np.ndarray, weights: np.ndarray | None = None, top_k: int = 10) -> Ranking:
        """Find the `top_k` models nearest to `query` (K, C), keypoint i weighted by `weights[i]`; exact.

        Raises DatabaseError when query or weights cannot be used (`kpred.database.search`).
        """
        query = checked_query(query, (self.half.shape[1], self.half.shape[2]))
        weigh = checked_weights(weights, len(query))
        wanted = min(checked_top_k(top_k), len(self))
        lower, limit = bounds(self.codes, self.errors, self.quantiser, query, weigh, wanted)
        rows = np.flatnonzero(lower <= limit)
        rows = rows[np.argsort(lower[rows], kind="stable")]
        # The nearest by their bounds settle how far the last one wanted is; few others can then still be nearer.
        first, rest = np.split(rows, [max(_FIRST_ROWS, 2 * wanted)])
        distances = self._exact(first, query, weigh)
        rest = rest[lower[rest] <= np.partition(distances, wanted - 1)[wanted - 1]]
        distances = np.concatenate([distances, self._exact(rest, query, weigh)])
        if self.release is not None:
            self.release()
        return nearest([self.id_of(int(row)) for row in (*first, *rest)], distances, wanted)

    def _exact(self, rows: np.ndarray, query: np.ndarray, weights: np.ndarray) -> np.ndarray:
        return exact_distances(self.half[rows], query, weights)


@dataclass(frozen=True, eq=False)
class GrowingIndex:
    """A table, and the models that were added since it was made."""

    table: TokenTable
    later: TokenIndex | None

    @property
    def model_ids(self) -> tuple[str, ...]:
        """All ids, ascending."""
        return tuple(sorted((*self.table.model_ids, *(self.later.model_ids if self.later else ()))))

    def ranked(self, query: np.ndarray, weights: np.ndarray | None = None, top_k: int = 10) -> Ranking:
        """Find the `top_k` models nearest to `query` (K, C); exact, ties by id."""
        found = self.table.ranked(query, weights, top_k)
        return sorted(found + self.later.ranked(query, weights, top_k))[:top_k] if self.later else found
