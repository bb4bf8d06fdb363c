"""How surely surface at a place would have been seen by the scanner: one number for whole scans and partial ones."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import torch
from torch import Tensor

from kpred.fitting.candidates import Candidates
from kpred.fitting.encoding import encode_scan
from kpred.nn import Model
from kpred.nn.visibility import VisibilityNetwork
from kpred.ops.trilinear import interpolate_grid
from kpred.ops.typing import Float

GRID_SIZE = 9
"""Nodes along each axis of the grid that visibility is computed at."""

GRID_STEPS = np.float32(1024)
"""Steps from 0 to 1 that predictions are rounded to."""

REACH = 1.2
"""The grid covers so much of the unit box around its middle."""

SURELY_HIDDEN, SURELY_SEEN = 0.35, 0.85
"""Predictions below and above count as 0 and 1: many points of little weight would outvote the few that were seen."""

HALF_SEEN = 0.5
"""Without a network, a place is seen as far as the keypoints near it are; at this confidence, fully."""

NEAR_KEYPOINTS = 0.3
"""Distance at which a keypoint's confidence counts 1 / e less, unit box."""


MIN_SIDE = 0.12
"""Furniture is thicker than this fraction of its longest side; a thinner scan is of one plate that alone was seen."""

BOX_NODES = 5
"""Nodes along each axis of a scan's box at which visibility is averaged."""

WHOLE_BOX, WHOLE_KNOWN_BOX = 0.85, 0.72
"""Mean visibility of a scan's box from which on networks for whole scans encode it.

Where the box of the whole object is known, less is lost by taking a scan for whole.
"""


FILLED = 0.08
"""A scan in the unit box of its whole object is whole only if no end of it is farther than this from the box's."""


@dataclass(frozen=True, eq=False)
class Visibility:
    """Visibility of places in the unit box of one scan, from 0 to 1.

    Attributes:
        grid: (9, 9, 9) at the nodes of a grid over [-REACH, REACH]^3; None where all is seen.
    """

    grid: Float[np.ndarray, "x y z"] | None = None

    def __call__(self, places: Float[np.ndarray, "places 3"]) -> Float[np.ndarray, " places"]:
        """Look up visibility at places in the unit box."""
        if self.grid is None:
            return np.ones(len(places), np.float32)
        reach = np.full(3, REACH)
        predicted = interpolate_grid(self.grid, -reach, reach, places)
        return np.clip((predicted - SURELY_HIDDEN) / (SURELY_SEEN - SURELY_HIDDEN), 0.0, 1.0)


def all_seen() -> Visibility:
    """Build the visibility of a scan that is known to be whole."""
    return Visibility()


def predicted(candidates: Candidates, model: Model) -> Visibility:
    """Predict the visibility around the scan of some candidates, in its unit box.

    Of a model without a visibility network the confidence of keypoints (paper: D_i) is spread over the box instead.
    """
    if model.visibility is not None:
        return predict_grid(candidates.target, model.visibility)
    assert candidates.keypoints is not None
    return spread_confidence(candidates.keypoints, candidates.confidence)


def predict_grid(scan: Float[Tensor, "scan 3"], network: VisibilityNetwork) -> Visibility:
    """Predict the visibility around a scan in its unit box (y up, front +z)."""
    reach = torch.full((3,), REACH)
    # The last bits of a prediction depend on the number of threads; a result may not.
    return Visibility(np.round(network.grid(scan, GRID_SIZE, -reach, reach).numpy() * GRID_STEPS) / GRID_STEPS)


def spread_confidence(keypoints: Float[Tensor, "keypoints 3"], confidence: Float[Tensor, " keypoints"]) -> Visibility:
    """Spread the confidence of keypoints over the unit box."""
    nodes = torch.cartesian_prod(*[torch.linspace(-REACH, REACH, GRID_SIZE)] * 3)
    weight = torch.softmax(-torch.cdist(nodes, keypoints) / NEAR_KEYPOINTS, dim=1)
    seen = weight @ (confidence / HALF_SEEN).clamp(max=1.0)
    return Visibility(seen.view(GRID_SIZE, GRID_SIZE, GRID_SIZE).numpy())


def fills_unit_box(scan: Float[Tensor, "scan 3"]) -> bool:
    """Check whether a scan spans the unit box along one axis and is centred in it along all, as a whole object is."""
    low, high = scan.amin(0), scan.amax(0)
    off_centre, short = (low + high).abs().max() / 2, 2 - (high - low).max()
    return float(off_centre) < FILLED and float(short) < FILLED


def lacks_parts(scan: Float[Tensor, "scan 3"], model: Model, category: str, known: bool) -> bool:
    """Decide whether a scan lacks parts of its object, so that networks for partial scans should encode it.

    Args:
        scan: in the unit box of what is seen, or of the whole where that is `known`; y up, front +z.
    """
    if known and not fills_unit_box(scan):
        return True
    least = WHOLE_KNOWN_BOX if known else WHOLE_BOX
    low, high = np.quantile(scan.numpy(), [0.01, 0.99], axis=0)
    if (high - low).min() < MIN_SIDE * (high - low).max():
        return True
    if model.visibility is not None:
        found = model.visibility.grid(scan, BOX_NODES, torch.from_numpy(low).float(), torch.from_numpy(high).float())
        return float(found.mean()) < least
    seen = encode_scan(scan[None], model[category], partial=False)
    return float((seen.confidence[0] / HALF_SEEN).clamp(max=1.0).mean()) < least
