"""What fitting reads of the database about the models it tries."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True, eq=False)
class Candidates:
    """What fitting needs of M models of one category, as float32 arrays in the unit box of each model."""

    model_ids: tuple[str, ...]
    keypoints: np.ndarray
    """(M, K, 3)"""
    points: np.ndarray
    """(M, N, 3)"""
    point_basis: np.ndarray
    """(M, N, K): deformed points are points + point_basis @ (target keypoints - keypoints)"""
