"""How far a model may be changed, and settings of the keypoints' refinement; no other package is needed for them."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Literal

from kpred.errors import ConfigError

Deform = Literal["auto", "none", "scale", "structure", "free", "paper"]
"""How far a model may be changed to fit a scan; `kpred.fit` says what each means."""


@dataclass(frozen=True)
class RefineConfig:
    """How keypoints are refined where a model may bend freely (`deform="free"`).

    Weights are relative to that of the scan's points, which is 1 in all.

    Attributes:
        iterations: rounds of nearest neighbours and least squares.
        points: points of the source and of the scan used in each round (all of them are used for the final error).
        prior: weight of the pull toward the network's keypoints, as a fraction of the data term's mean diagonal.
        unseen: weight of the pull of the surface that a partial scan does not show toward where the network put it.
        free_space: weight of the pull of surface in space that the sensor looked through toward what it saw there;
            partial scans whose sensor is known.
        reflection: weight of the scan's mirror image; partial scans.
        robust: a point farther from its match than this many times the median distance counts less and less; 0 is off.
        finalists: candidates of a whole scan that are refined to the end; the others stop after a few quick rounds.
            Those of a partial scan are compared with one another, and are half as many again.

    Raises:
        ConfigError: a setting has an impossible value.
    """

    iterations: int = 8
    points: int = 1024
    prior: float = 0.005
    unseen: float = 1.0
    free_space: float = 1.0
    reflection: float = 0.5
    robust: float = 8.0
    finalists: int = 4

    def __post_init__(self) -> None:
        for name in ("iterations", "points", "finalists"):
            if getattr(self, name) < 1:
                raise ConfigError(f"Refinement setting {name} must be at least 1, but is {getattr(self, name)}.")
        for name in ("prior", "unseen", "free_space", "reflection", "robust"):
            if not getattr(self, name) >= 0:
                raise ConfigError(f"Refinement setting {name} must not be negative, but is {getattr(self, name)}.")

    def most_finalists(self, partial: bool) -> int:
        """Count the candidates of such a scan that are refined to the end."""
        return self.finalists * 3 // 2 if partial else self.finalists

    def quick(self) -> RefineConfig:
        """Reduce to the few rounds, with half of the points, by which the finalists are found."""
        return replace(self, iterations=3, points=max(1, self.points // 2))
