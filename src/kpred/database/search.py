"""Exact retrieval by the weighted L1 distance between per-keypoint tokens (paper, retrieval under occlusion).

distance(m) = sum_i w_i * || T_query^i - T_m^i ||_1, all w_i = 1 for full scans.

Every way of searching first bounds the distances and then sums those of the few models that are left in float64 and
in one order, so that all of them give the same numbers to the bit as `tests/twins/search_reference.py`, whatever the
machine.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol, runtime_checkable

import numpy as np
import torch

from kpred.errors import DatabaseError
from kpred.ops.typing import Float

_ROUNDING = 1e-4
"""Float32 sums of 12 x 128 differences are off by much less than this fraction."""


@dataclass(frozen=True, eq=False)
class SearchResult:
    """The nearest models, nearest first; models at the same distance by their id."""

    model_ids: tuple[str, ...]
    distances: Float[np.ndarray, " models"]
    """(k,) weighted L1 distances, in units of the tokens"""


Ranking = list[tuple[float, str]]
"""Distances in float64 and ids, nearest first, ties by id."""


@runtime_checkable
class Index(Protocol):
    """Models of one category that can be searched."""

    @property
    def model_ids(self) -> tuple[str, ...]:
        """All ids, ascending."""
        ...

    def ranked(self, query: np.ndarray, weights: np.ndarray | None = None, top_k: int = 10) -> Ranking:
        """Find the `top_k` models nearest to `query` (K, C), keypoint i weighted by `weights[i]` (K,)."""
        ...


class TokenIndex:
    """The tokens of one category in memory, laid out for one pass over each keypoint."""

    def __init__(self, model_ids: tuple[str, ...], tokens: Float[np.ndarray, "models keypoints token_size"]) -> None:
        """Build an index of M ids in ascending order and tokens (M, K, C)."""
        self.model_ids = model_ids
        self.tokens = torch.from_numpy(np.ascontiguousarray(tokens.transpose(1, 0, 2), dtype=np.float32))

    def search(self, query: np.ndarray, weights: np.ndarray | None = None, top_k: int = 10) -> SearchResult:
        """Find as `ranked`, as a result."""
        return as_result(self.ranked(query, weights, top_k))

    def ranked(self, query: np.ndarray, weights: np.ndarray | None = None, top_k: int = 10) -> Ranking:
        """Find the `top_k` models nearest to `query` (K, C), keypoint i weighted by `weights[i]` (K,).

        Raises DatabaseError when the query's shape is not the tokens', when a number in it is not finite, or when
        weights are negative, not finite or all zero.
        """
        count, models, size = self.tokens.shape
        query, weigh = checked_query(query, (count, size)), checked_weights(weights, count)
        per_keypoint = torch.cdist(torch.from_numpy(query)[:, None], self.tokens, p=1.0)[:, 0]
        rough = (torch.from_numpy(weigh) @ per_keypoint).numpy()
        rows = np.arange(models)
        if checked_top_k(top_k) < models:
            limit = np.partition(rough, top_k - 1)[top_k - 1]
            rows = np.flatnonzero(rough <= limit * (1 + _ROUNDING) + 1e-30)
        distances = exact_distances(self.tokens[:, rows].numpy().transpose(1, 0, 2), query, weigh)
        return nearest([self.model_ids[row] for row in rows], distances, top_k)


def checked_query(query: np.ndarray, shape: tuple[int, int]) -> Float[np.ndarray, "keypoints token_size"]:
    """Return `query` as finite float32 (K, C), or raise DatabaseError."""
    array = np.asarray(query, dtype=np.float32)
    if array.shape != shape or not np.isfinite(array).all():
        raise DatabaseError(
            f"Query tokens must be {shape} finite numbers; their shape is {array.shape}. "
            "Encode the scan with the model that made the database."
        )
    return array


def checked_weights(weights: np.ndarray | None, count: int) -> Float[np.ndarray, " keypoints"]:
    """Return `weights` as float32 (count,), all 1 for None, or raise DatabaseError when they are no weights."""
    if weights is None:
        return np.ones(count, np.float32)
    array = np.asarray(weights, dtype=np.float32)
    if array.shape != (count,) or not np.isfinite(array).all() or (array < 0).any() or not array.any():
        raise DatabaseError(f"Search weights must be {count} finite numbers of at least 0, not all 0; got {array}.")
    return array


def checked_top_k(top_k: int) -> int:
    """Return `top_k`, or raise DatabaseError when it is less than 1."""
    if top_k < 1:
        raise DatabaseError(f"The number of models to retrieve must be at least 1, not {top_k}.")
    return top_k


def exact_distances(
    tokens: Float[np.ndarray, "models keypoints token_size"],
    query: Float[np.ndarray, "keypoints token_size"],
    weights: np.ndarray,
) -> Float[np.ndarray, " models"]:
    """Compute weighted L1 distances (M,) in float64 of tokens (M, K, C) to `query` (K, C)."""
    differences = np.subtract(tokens, query, dtype=np.float64, order="C")
    per_keypoint = np.abs(differences, out=differences).sum(axis=2)
    distances = np.zeros(len(tokens))
    for keypoint, weight in enumerate(np.asarray(weights, dtype=np.float64)):
        distances += weight * per_keypoint[:, keypoint]
    return distances


def nearest(model_ids: Sequence[str], distances: Float[np.ndarray, " models"], top_k: int) -> Ranking:
    """Select the `top_k` smallest of `distances` (M,), ties by id."""
    return sorted(zip(distances.tolist(), model_ids, strict=True))[: checked_top_k(top_k)]


def as_result(ranking: Ranking) -> SearchResult:
    """Convert a ranking to a search result."""
    return SearchResult(tuple(name for _, name in ranking), np.array([d for d, _ in ranking], dtype=np.float32))
