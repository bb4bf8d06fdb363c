"""Settings of refinement; they need no other package, so that the command line shows them at once."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Literal

from kpred.errors import ConfigError


@dataclass(frozen=True)
class RefineConfig:
    """How keypoints are refined, and after them a cage around the best candidates.

    Weights are against that of the scan's points, which is 1 in all.

    Attributes:
        iterations: rounds of nearest neighbours and least squares.
        points: points of the source and of the target used in each round (all of them are used for the final error).
        prior: weight of the pull toward the network's keypoints, as a share of the data term's mean diagonal.
        unseen: weight of the pull of the surface that a partial scan does not show toward where the network put it.
        free_space: weight of the pull of surface in space that the sensor looked through toward what it saw there;
            partial scans whose sensor is known.
        reflection: weight of the scan's mirror image; partial scans.
        robust: a point farther from its match than this many times the median distance counts less and less; 0 is off.
        trim: share of the scan's points, those farthest from the result, that do not count; beside `robust` it costs
            more than 2 % of outliers do.
        box: what is refined of the candidate's box: nothing, its place and size, or its place and each axis' size.
        box_prior: weight of the pull of the box's shift and of its scale, less 1, toward 0.
        finalists: candidates of a full scan that are refined to the end; the others stop after a few quick rounds.
            Those of a partial scan are compared with one another, and are half as many again.
        cage: which scans' results are refined by a cage after the keypoints (`kpred.fitting.cage_refinement`).
        cage_finalists: candidates of a full scan that get a cage; of a partial scan one does.
        cage_iterations: rounds of nearest neighbours and least squares of a cage.
        cage_smoothness: weight of the cage's stiffness; cage_symmetry: of its not being mirror symmetric.
        cage_robust: as `robust`, for the cage.
    """

    iterations: int = 8
    points: int = 1024
    prior: float = 0.005
    unseen: float = 1.0
    free_space: float = 1.0
    reflection: float = 0.5
    robust: float = 8.0
    trim: float = 0.0
    box: Literal["fixed", "similarity", "per_axis"] = "fixed"
    box_prior: float = 0.03
    finalists: int = 4
    cage: Literal["always", "full", "never"] = "always"
    cage_finalists: int = 2
    cage_iterations: int = 8
    cage_smoothness: float = 1e-6
    cage_symmetry: float = 1e-4
    cage_robust: float = 20.0

    def most_finalists(self, partial: bool) -> int:
        """How many candidates of such a scan are refined to the end."""
        return self.finalists * 3 // 2 if partial else self.finalists

    def quick(self) -> RefineConfig:
        """The few quick rounds by which the finalists are found."""
        return replace(self, iterations=3, points=max(1, self.points // 2))

    def has_cage(self, partial: bool) -> bool:
        """Whether the result of such a scan is refined by a cage."""
        return self.cage == "always" or (self.cage == "full" and not partial)

    def __post_init__(self) -> None:
        for name in ("iterations", "points", "finalists", "cage_finalists", "cage_iterations"):
            if getattr(self, name) < 1:
                raise ConfigError(f"Refinement setting {name} must be at least 1, but is {getattr(self, name)}.")
        weights = ("prior", "unseen", "free_space", "reflection", "robust", "box_prior")
        for name in (*weights, "cage_smoothness", "cage_symmetry", "cage_robust"):
            if not getattr(self, name) >= 0:
                raise ConfigError(f"Refinement setting {name} must not be negative, but is {getattr(self, name)}.")
        if not 0 <= self.trim < 1:
            raise ConfigError(f"Refinement setting trim must be a share from 0 to less than 1, but is {self.trim}.")
