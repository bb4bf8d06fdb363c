"""Exact retrieval by the weighted L1 distance between per-keypoint tokens (paper, retrieval under occlusion).

distance(m) = sum_i w_i * || T_query^i - T_m^i ||_1, all w_i = 1 for full scans.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import torch

from kpred.errors import DatabaseError


@dataclass(frozen=True, eq=False)
class SearchResult:
    """The nearest models, nearest first; models at the same distance by their id."""

    model_ids: tuple[str, ...]
    distances: np.ndarray
    """(k,) weighted L1 distances, in units of the tokens"""


class TokenIndex:
    """The tokens of one category in memory, laid out for one pass over each keypoint."""

    def __init__(self, model_ids: tuple[str, ...], tokens: np.ndarray) -> None:
        """`model_ids`: M ids in ascending order; `tokens`: (M, K, C)."""
        self.model_ids = model_ids
        self.tokens = torch.from_numpy(np.ascontiguousarray(tokens.transpose(1, 0, 2), dtype=np.float32))

    def search(self, query: np.ndarray, weights: np.ndarray | None = None, top_k: int = 10) -> SearchResult:
        """The `top_k` models nearest to `query` (K, C), keypoint i weighing `weights[i]` (K,).

        Raises DatabaseError when the query's shape is not the tokens', when a number in it is not finite, or when
        weights are negative, not finite or all zero.
        """
        count, _, size = self.tokens.shape
        query = np.asarray(query, dtype=np.float32)
        if query.shape != (count, size) or not np.isfinite(query).all():
            raise DatabaseError(
                f"Query tokens must be ({count}, {size}) finite numbers; their shape is {query.shape}. "
                "Encode the scan with the model that made the database."
            )
        per_keypoint = torch.cdist(torch.from_numpy(query)[:, None], self.tokens, p=1.0)[:, 0]
        if weights is None:
            distances = per_keypoint.sum(0)
        else:
            distances = torch.from_numpy(checked_weights(weights, count)) @ per_keypoint
        return nearest(self.model_ids, distances.numpy(), top_k)


def checked_weights(weights: np.ndarray, count: int) -> np.ndarray:
    """`weights` as float32 (count,), or DatabaseError when they cannot weigh a distance."""
    array = np.asarray(weights, dtype=np.float32)
    if array.shape != (count,) or not np.isfinite(array).all() or (array < 0).any() or not array.any():
        raise DatabaseError(f"Search weights must be {count} finite numbers of at least 0, not all 0; got {array}.")
    return array


def nearest(model_ids: tuple[str, ...], distances: np.ndarray, top_k: int) -> SearchResult:
    """The `top_k` smallest of `distances` (M,), ties in the order of `model_ids`."""
    if top_k < 1:
        raise DatabaseError(f"The number of models to retrieve must be at least 1, not {top_k}.")
    rows = np.arange(len(distances))
    if top_k < len(distances):
        # All rows at most as far as the k-th, ties included, so that the stable sort decides between them.
        rows = np.flatnonzero(distances <= np.partition(distances, top_k - 1)[top_k - 1])
    order = rows[np.argsort(distances[rows], kind="stable")][:top_k]
    return SearchResult(tuple(model_ids[row] for row in order), distances[order].astype(np.float32))


def reference_search(
    model_ids: tuple[str, ...],
    tokens: np.ndarray,
    query: np.ndarray,
    weights: np.ndarray | None = None,
    top_k: int = 10,
) -> SearchResult:
    """The same as `TokenIndex.search`, written out in float64 for tests: tokens (M, K, C), query (K, C)."""
    weigh = np.ones(len(query)) if weights is None else np.asarray(weights, dtype=np.float64)
    distances = []
    for model in np.asarray(tokens, dtype=np.float64):
        distances.append(sum(w * np.abs(a - b).sum() for w, a, b in zip(weigh, query, model, strict=True)))
    ranked = sorted(zip(distances, model_ids, strict=True))[:top_k]
    return SearchResult(tuple(name for _, name in ranked), np.array([d for d, _ in ranked], dtype=np.float32))
