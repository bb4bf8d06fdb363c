"""What the networks see in a scan: keypoints, retrieval tokens and confidence, for each hypothesis of its frame."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any
from weakref import WeakKeyDictionary

import torch
from torch import Tensor

from kpred.nn import KPRed
from kpred.nn.keypoints import thinned

KEYPOINT_STEPS = 2.0**16
"""Steps of a unit length that keypoints of a scan are rounded to."""


@dataclass(frozen=True, eq=False)
class ScanEncoding:
    """H hypotheses of one scan, unit-box coordinates.

    Attributes:
        points: (H, N, 3); keypoints: (H, K, 3); tokens: (H, K, C); confidence: (H, K), D_i.
        weights: (H, K) of the tokens in the search: the confidence of partial scans, ones for full ones.
    """

    points: Tensor
    keypoints: Tensor
    tokens: Tensor
    confidence: Tensor
    weights: Tensor


def encode_scan(points: Tensor, network: KPRed, partial: bool) -> ScanEncoding:
    """Encode clouds (H, N, 3) that lie in unit boxes (paper Sec. 3.2 for full, 3.3 for partial scans)."""
    if isinstance(network, EncodedAhead):
        found = None if partial else network.seen(points)
        return network.encode(points, partial) if found is None else found
    few = thinned(points)
    with torch.inference_mode():
        if partial:
            keypoints = _rounded(network.partial_keypoints(few))
            tokens = network.partial_retrieval_tokens(points, keypoints)
        else:
            keypoints = _rounded(network.keypoints(few))
            tokens = network.retrieval_tokens(points, keypoints)
        confidence = network.confidence(points, keypoints)
    weights = confidence if partial else torch.ones_like(confidence)
    # Nothing seen anywhere: every region counts the same.
    weights = torch.where(weights.sum(1, keepdim=True) > 0, weights, torch.ones_like(weights))
    return ScanEncoding(points, keypoints, tokens, confidence, weights)


def _rounded(keypoints: Tensor) -> Tensor:
    """Round keypoints: their last bits depend on the number of threads, and a result may not."""
    return torch.round(keypoints * KEYPOINT_STEPS) / KEYPOINT_STEPS


class EncodedAhead(KPRed):
    """Networks that have read many full clouds in one batch already; everything else they do as they always do.

    One of these clouds alone is then not read again. Numbers differ from those of a single cloud by rounding.
    """

    _own: KPRed

    def __init__(self, network: KPRed, clouds: Tensor) -> None:
        """Encode `clouds` (S, N, 3) in unit boxes as one batch."""
        torch.nn.Module.__init__(self)
        self.config = network.config
        # Its parts are those of the other: neither copied nor registered a second time.
        self._modules = network._modules
        object.__setattr__(self, "_own", network)
        together = encode_scan(clouds, network, partial=False)
        self._seen = {_content(cloud): _row(together, row) for row, cloud in enumerate(clouds)}

    def seen(self, points: Tensor) -> ScanEncoding | None:
        """Return the encoding of this cloud (1, N, 3), or None if it was not in the batch."""
        return self._seen.get(_content(points[0])) if len(points) == 1 else None

    def encode(self, points: Tensor, partial: bool) -> ScanEncoding:
        """Return the encoding from the batch, or compute it."""
        return encode_scan(points, self._own, partial)

    def fingerprint(self) -> str:
        """Return the networks' fingerprint, computed once."""
        return _fingerprint(self._own)


_fingerprints: WeakKeyDictionary[KPRed, str] = WeakKeyDictionary()


def _fingerprint(network: KPRed) -> str:
    found = _fingerprints.get(network)
    if found is None:
        found = _fingerprints[network] = network.fingerprint()
    return found


def _content(cloud: Tensor) -> bytes:
    return cloud.contiguous().numpy().tobytes()


def _row(seen: ScanEncoding, row: int) -> ScanEncoding:
    fields: dict[str, Any] = {name: getattr(seen, name)[row : row + 1] for name in ScanEncoding.__dataclass_fields__}
    return ScanEncoding(**fields)
