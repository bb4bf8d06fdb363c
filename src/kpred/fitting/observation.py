"""What the networks see in a scan: keypoints, retrieval tokens and confidence, for each hypothesis of its frame."""

from __future__ import annotations

from dataclasses import dataclass

import torch
from torch import Tensor

from kpred.nn import KPRed
from kpred.nn.keypoints import thinned


@dataclass(frozen=True, eq=False)
class Observation:
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


def observe(points: Tensor, network: KPRed, partial: bool) -> Observation:
    """Encode clouds (H, N, 3) that lie in unit boxes (paper Sec. 3.2 for full, 3.3 for partial scans)."""
    few = thinned(points)
    with torch.inference_mode():
        if partial:
            keypoints = network.partial_keypoints(few)
            tokens = network.partial_retrieval_tokens(points, keypoints)
        else:
            keypoints = network.keypoints(few)
            tokens = network.retrieval_tokens(points, keypoints)
        confidence = network.confidence(points, keypoints)
    weights = confidence if partial else torch.ones_like(confidence)
    # Nothing seen anywhere: every region counts the same.
    weights = torch.where(weights.sum(1, keepdim=True) > 0, weights, torch.ones_like(weights))
    return Observation(points, keypoints, tokens, confidence, weights)
