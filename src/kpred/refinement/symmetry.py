"""Furniture is mirror symmetric about the plane x = middle of its box: what one half shows holds for the other, weakly.

The scan's mirror image gives a partial scan's refinement further targets, so that the unseen half follows the seen one.
They count little where that is not plausible: where the keypoints that the network expects of the whole object are not
symmetric themselves, and where the sensor looked through the place of a mirrored point.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import torch
from torch import Tensor

from kpred.ops.nearest import nearest_neighbours
from kpred.ops.typing import Float
from kpred.refinement.free_space import DepthPicture

ASYMMETRY = 0.3
"""Keypoints that are on average so far from their mirror images, unit box, lower the weights to 1 / e."""

POINTS = 128
"""Points of the scan that are mirrored."""


@dataclass(frozen=True, eq=False)
class Reflection:
    """Weak targets in the unseen half.

    Attributes:
        points: (R, 3) mirrored points of the scan, unit box; weight: (R,) how plausible each is, in [0, 1].
    """

    points: Tensor
    weight: Tensor


def reflect(
    scan: Float[Tensor, "scan 3"], keypoints: Float[Tensor, "keypoints 3"], pictures: Sequence[DepthPicture] = ()
) -> Reflection:
    """Mirror a scan about x = 0, the middle plane of the whole object's unit box.

    Args:
        keypoints: that the network expects of the whole object, unit box.
        pictures: what sensors saw of the scan, unit box; none where it is not known where they stood.
    """
    mirrored = _mirrored(scan[:: max(1, len(scan) // POINTS)])
    weight = torch.full_like(mirrored[:, 0], math.exp(-((asymmetry(keypoints) / ASYMMETRY) ** 2)))
    for picture in pictures:
        weight = torch.where(picture.beyond(mirrored)[0] > 0, 0.0, weight)
    return Reflection(mirrored, weight)


def asymmetry(keypoints: Float[Tensor, "keypoints 3"]) -> float:
    """Mean distance from each mirrored keypoint to the nearest keypoint, in their unit; 0 for a symmetric set."""
    squared, _ = nearest_neighbours(_mirrored(keypoints)[None], keypoints[None])
    return float(squared.sqrt().mean())


def _mirrored(points: Tensor) -> Tensor:
    return points * points.new_tensor([-1.0, 1.0, 1.0])
