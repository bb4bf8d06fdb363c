"""Whether confidence can be believed: of the fits that say 80 %, are 80 % right, and do right ones say more?

Expected calibration error (ECE, Naeini et al. 2015): mean over all fits of |mean confidence - fraction right| of their
bin; bins of equal width. Area under the ROC curve (AUC): probability that a right fit is more confident than a wrong
one.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.stats import rankdata

BINS = 10


@dataclass(frozen=True)
class Bin:
    """Fits whose confidence lies in [low, high), the last bin closed.

    Attributes:
        n: how many; at least 1. confidence: their mean; right: fraction of them that is right.
    """

    low: float
    high: float
    n: int
    confidence: float
    right: float


@dataclass(frozen=True)
class Reliability:
    """How confidence and outcome go together.

    Attributes:
        bins: those that hold a fit, by rising confidence; n: number of fits.
        ece: expected calibration error, 0 (calibrated) to 1.
        auc: 0.5 if confidence says nothing, 1 if it separates right from wrong; None without both.
    """

    bins: tuple[Bin, ...]
    n: int
    ece: float
    auc: float | None


def reliability(confidence: Sequence[float], right: Sequence[bool], bins: int = BINS) -> Reliability:
    """Reliability of at least one fit: probabilities in [0, 1] of being right, and whether each was.

    Raises:
        ValueError: no fits, different lengths, or a confidence outside [0, 1].
    """
    said, true = np.asarray(confidence, dtype=np.float64), np.asarray(right, dtype=bool)
    if said.shape != true.shape or not len(said):
        raise ValueError(f"Reliability needs pairs, but has {len(said)} confidences and {len(true)} outcomes.")
    if not ((said >= 0) & (said <= 1)).all():
        raise ValueError("Confidences are probabilities in [0, 1].")
    member = np.minimum((said * bins).astype(np.int64), bins - 1)
    found = tuple(
        Bin(
            low=number / bins,
            high=(number + 1) / bins,
            n=int((member == number).sum()),
            confidence=float(said[member == number].mean()),
            right=float(true[member == number].mean()),
        )
        for number in np.unique(member).tolist()
    )
    ece = sum(part.n * abs(part.confidence - part.right) for part in found) / len(said)
    return Reliability(found, len(said), float(ece), area_under_roc(said, true))


def area_under_roc(score: Sequence[float] | np.ndarray, positive: Sequence[bool] | np.ndarray) -> float | None:
    """Probability that a positive scores higher than a negative, ties counting half; None unless there are both."""
    true = np.asarray(positive, dtype=bool)
    positives, negatives = int(true.sum()), int((~true).sum())
    if not positives or not negatives:
        return None
    ranks = rankdata(np.asarray(score, dtype=np.float64))
    return float((ranks[true].sum() - positives * (positives + 1) / 2) / (positives * negatives))
