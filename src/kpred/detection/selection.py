"""Selection among overlapping proposals: the best first, each taking its pieces from the others."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from kpred.detection.propose import PreparedRoom
from kpred.ops.typing import Float

MAX_IOU = 0.25
"""Proposals that overlap a better one by more than this IoU are other readings of the same object."""

MAX_INSIDE = 0.5
"""Fraction of a proposal's voxels that may belong to better ones."""


def select_proposals(
    room: PreparedRoom,
    proposals: Sequence[frozenset[int]],
    scores: Float[np.ndarray, " proposals"],
    min_score: float,
) -> list[tuple[int, frozenset[int]]]:
    """Return rows of the selected proposals by falling score, with the pieces that no better one has."""
    if room.pieces is None:
        return []
    sizes = room.pieces.sizes
    taken: set[int] = set()
    chosen: list[tuple[int, frozenset[int]]] = []
    for row in np.argsort(-scores, kind="stable").tolist():
        if scores[row] < min_score:
            break
        pieces = proposals[row]
        size = _voxels(pieces, sizes)
        if _voxels(pieces & taken, sizes) > MAX_INSIDE * size:
            continue
        if any(_iou(pieces, proposals[other], sizes) > MAX_IOU for other, _ in chosen):
            continue
        chosen.append((row, pieces - taken))
        taken |= pieces
    return chosen


def _voxels(pieces: frozenset[int] | set[int], sizes: np.ndarray) -> int:
    return int(sizes[list(pieces)].sum()) if pieces else 0


def _iou(one: frozenset[int], other: frozenset[int], sizes: np.ndarray) -> float:
    return _voxels(one & other, sizes) / max(_voxels(one | other, sizes), 1)
