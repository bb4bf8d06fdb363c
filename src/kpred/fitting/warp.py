"""A warp of space by a lattice of control points: what cage refinement finds, for any point of the model."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import torch
from torch import Tensor

from kpred.ops.lattice import lattice_weights
from kpred.ops.typing import Float

_AT_ONCE = 16_384
"""Points whose weights are held at once: some fifteen megabytes."""


@dataclass(frozen=True, eq=False)
class Warp:
    """From the source's unit box, as it is in the database, to the scan's.

    Attributes:
        half: (3,) half the size of the lattice's box, whose middle is the origin.
        displacement: (controls, 3) of the control points, unit box.
    """

    half: Tensor
    displacement: Tensor

    def __call__(self, points: Float[np.ndarray, "points 3"]) -> Float[np.ndarray, "points 3"]:
        """Where points of the source go."""
        found = []
        for part in torch.from_numpy(np.asarray(points, dtype=np.float32)).split(_AT_ONCE):
            found.append(part + lattice_weights(part, -self.half, self.half) @ self.displacement)
        return torch.cat(found).numpy().astype(np.float64)
