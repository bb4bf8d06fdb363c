"""Which true object each detected one is, by the overlap of their points."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from kpred.evaluation.rooms.labelled import LabelledRoom, true_objects
from kpred.ops.typing import Int
from kpred.scenes.objects import SceneObject


@dataclass(frozen=True)
class Match:
    """A detected object and the true one that it overlaps most.

    Attributes:
        category, score: of the detected object.
        true: category of the true one, "" where labels do not say, None where it overlaps none.
        iou: intersection over union of their points; row: of the true one in the room.
    """

    category: str
    score: float
    true: str | None
    iou: float
    row: int


def match_objects(room: LabelledRoom, objects: Sequence[SceneObject]) -> list[Match]:
    """Match detected objects, the surest first, each to the true object with the largest IoU of points."""
    sizes = np.bincount(room.instance[room.instance >= 0], minlength=len(room.categories))
    shown = true_objects(room)
    result = []
    for item in objects:
        inside = _counts(room.instance[item.indices], len(room.categories))
        iou = inside / np.maximum(sizes + len(item.indices) - inside, 1)
        row = int(iou.argmax()) if len(iou) else -1
        overlaps = row in shown and iou[row] > 0
        score = 1.0 if item.score is None else item.score
        result.append(
            Match(
                str(item.category),
                score,
                room.categories[row] if overlaps else None,
                float(iou[row]) if overlaps else 0.0,
                row if overlaps else -1,
            )
        )
    return sorted(result, key=lambda match: -match.score)


def right_rows(matches: Sequence[Match], min_iou: float, any_category: bool = False) -> list[bool]:
    """Decide for each match whether it is right: enough overlap, right category, no surer one of that object."""
    taken: set[int] = set()
    result = []
    for match in matches:
        is_right = match.iou >= min_iou and match.row not in taken and (any_category or match.true == match.category)
        if is_right:
            taken.add(match.row)
        result.append(is_right)
    return result


def counted(matches: Sequence[Match], right: Sequence[bool], category: str) -> list[bool]:
    """List right and wrong among the detections of a category; what labels leave open is left out."""
    return [hit for match, hit in zip(matches, right, strict=True) if match.category == category and match.true != ""]


def average_precision(rooms: Sequence[tuple[Sequence[Match], Sequence[bool]]], category: str, shown: int) -> float:
    """Compute the area under precision over recall of a category, over all rooms; the score orders detections.

    Args:
        rooms: detections of each room, and which of them are right; shown: number of true objects.
    """
    scored = [
        (match.score, hit)
        for matches, right in rooms
        for match, hit in zip(matches, right, strict=True)
        if match.category == category and match.true != ""
    ]
    if not scored or not shown:
        return 0.0
    hits = np.array([hit for _, hit in sorted(scored, key=lambda pair: -pair[0])])
    precision = np.cumsum(hits) / np.arange(1, len(hits) + 1)
    # At each recall, the best precision at that recall or a higher one.
    envelope = np.maximum.accumulate(precision[::-1])[::-1]
    return float(envelope[hits].sum() / shown)


def _counts(rows: Int[np.ndarray, " points"], count: int) -> np.ndarray:
    return np.bincount(rows[rows >= 0], minlength=count)[:count]
