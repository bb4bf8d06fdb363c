"""Proposals: sets of pieces that may be one object, from trees that join the likeliest pieces first."""

from __future__ import annotations

import heapq
from collections.abc import Iterable

import numpy as np
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components

from kpred.detection.adjacency import Pieces
from kpred.ops.typing import Float, Int

MIN_HEIGHT, MAX_WIDTH, MIN_WIDTH = 0.25, 4.5, 0.2
"""Metres: top above the floor at least; longest side in plan at most and at least."""

MIN_VOXELS = 60
RADII = (0.05, 0.09)
"""Metres: pieces nearer than this are also joined without regard to their shape."""

VARIANTS, DOUBT = 4, 1.0
"""Further trees, and the standard deviation of the noise on their log-odds: the networks' odds are not certain."""

BANDS = ((0.08, 1.1), (0.08, 0.66), (0.3, 1.3))
"""Metres: pieces in these heights alone are joined too, which parts chairs from the table above them."""


def merge_trees(
    pieces: Pieces,
    pairs: Int[np.ndarray, "pairs 2"],
    odds: Float[np.ndarray, " pairs"],
    contact: Float[np.ndarray, "pairs 5"],
) -> list[frozenset[int]]:
    """List sets of pieces that may be one object, each once.

    Args:
        odds: log-odds that a pair is of one object; contact: how the pairs touch (`touching`).
    """
    found: set[frozenset[int]] = {frozenset([piece]) for piece in range(len(pieces.sizes))}
    weights = np.exp(contact[:, 0]), np.ones(len(pairs))
    rng = np.random.default_rng(0)
    for number in range(len(weights) + VARIANTS):
        noise = DOUBT * rng.standard_normal(len(odds)) * (number >= len(weights))
        found |= set(_agglomerate(len(pieces.sizes), pairs, odds + noise, weights[number % 2]))
    gap = contact[:, 1]
    for band in (None, *BANDS):
        inside = np.ones(len(pieces.sizes), dtype=bool)
        if band is not None:
            inside = (pieces.middle[:, 2] > band[0]) & (pieces.high[:, 2] < band[1])
        for radius in RADII:
            joined = (gap * 0.09 <= radius) & inside[pairs].all(axis=1)
            found |= set(_components(len(pieces.sizes), pairs[joined]))
    return [one for one in found if _is_plausible(one, pieces)]


def _is_plausible(members: frozenset[int], pieces: Pieces) -> bool:
    rows = np.fromiter(members, np.int64)
    low, high = pieces.low[rows].min(axis=0), pieces.high[rows].max(axis=0)
    width = float((high - low)[:2].max())
    return bool(
        pieces.sizes[rows].sum() >= MIN_VOXELS
        and MIN_WIDTH <= width <= MAX_WIDTH
        and high[2] >= MIN_HEIGHT
        and high[2] - low[2] >= 0.04
    )


def _components(count: int, pairs: np.ndarray) -> Iterable[frozenset[int]]:
    graph = coo_matrix((np.ones(len(pairs)), (pairs[:, 0], pairs[:, 1])), shape=(count, count))
    _, label = connected_components(graph, directed=False)
    order = np.argsort(label, kind="stable")
    groups = np.split(order, np.flatnonzero(np.diff(label[order])) + 1)
    return (frozenset(group.tolist()) for group in groups if len(group) > 1)


def _agglomerate(count: int, pairs: np.ndarray, odds: np.ndarray, weight: np.ndarray) -> Iterable[frozenset[int]]:
    """Join the pair of sets with the highest mean odds, again and again; yield every set that arises."""
    members: dict[int, frozenset[int]] = {piece: frozenset([piece]) for piece in range(count)}
    links: dict[int, dict[int, tuple[float, float]]] = {piece: {} for piece in range(count)}
    heap: list[tuple[float, int, int]] = []
    for (one, other), value, amount in zip(pairs.tolist(), odds.tolist(), weight.tolist(), strict=True):
        links[one][other] = links[other][one] = (value * amount, amount)
        heap.append((-value, one, other))
    heapq.heapify(heap)
    fresh = count
    while heap:
        negative, one, other = heapq.heappop(heap)
        if one not in members or other not in members:
            continue
        union = members.pop(one) | members.pop(other)
        merged: dict[int, tuple[float, float]] = {}
        for old in (links.pop(one), links.pop(other)):
            for neighbour, (total, amount) in old.items():
                if neighbour in members:
                    before = merged.get(neighbour, (0.0, 0.0))
                    merged[neighbour] = (before[0] + total, before[1] + amount)
        members[fresh], links[fresh] = union, merged
        for neighbour, (total, amount) in merged.items():
            links[neighbour].pop(one, None)
            links[neighbour].pop(other, None)
            links[neighbour][fresh] = (total, amount)
            heapq.heappush(heap, (-total / amount, fresh, neighbour))
        yield union
        fresh += 1
