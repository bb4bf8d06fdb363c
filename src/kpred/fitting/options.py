"""Options of a fit, checked once."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Literal, get_args

import numpy as np

from kpred.errors import ConfigError
from kpred.fitting.deform import Deform
from kpred.pose.estimators import PoseEstimator
from kpred.preprocessing.config import CleanConfig
from kpred.refinement.config import RefineConfig
from kpred.refinement.structure_config import StructureConfig
from kpred.shapes.unit_name import UNIT_NAMES, UnitName

OVERSAMPLING = 4
"""Models retrieved for each that is deformed (docs/notes/deformation_trials.md)."""


@dataclass(frozen=True, eq=False)
class FitOptions:
    """Options of one fit; `kpred.fit` says what they mean.

    Raises:
        ConfigError: an option has an impossible value.
    """

    top_k: int = 10
    frame: Literal["auto", "known"] = "auto"
    deform: Deform = "auto"
    partial: bool | None = None
    up: str = "auto"
    pose: PoseEstimator | str | None = None
    clean: bool | CleanConfig = True
    seed: int = 0
    model_id: str | None = None
    refinement: RefineConfig = field(default_factory=RefineConfig)
    structure: StructureConfig = field(default_factory=StructureConfig)
    sensors: np.ndarray | None = None
    floor: float | None = None
    unit: UnitName | Literal["auto"] = "auto"

    def __post_init__(self) -> None:
        if self.top_k < 1:
            raise ConfigError(f"top_k must be at least 1, but is {self.top_k}.")
        if self.frame not in ("auto", "known"):
            raise ConfigError(f"frame must be 'auto' or 'known', but is '{self.frame}'.")
        if self.deform not in get_args(Deform):
            raise ConfigError(f"deform must be one of {', '.join(get_args(Deform))}, but is '{self.deform}'.")
        if self.floor is not None and not np.isfinite(self.floor):
            raise ConfigError(f"floor must be a finite height, but is {self.floor}.")
        if self.unit not in ("auto", *UNIT_NAMES):
            raise ConfigError(f"unit must be auto or one of {', '.join(UNIT_NAMES)}, but is '{self.unit}'.")

    @property
    def retrieved(self) -> int:
        """Models retrieved by tokens; where a sketch of the deformation selects among them, more than are deformed."""
        return self.top_k * (OVERSAMPLING if self.deform in ("auto", "structure") else 1)

    @property
    def known(self) -> bool:
        """Whether the scan lies in its whole object's unit box."""
        return self.frame == "known"

    @property
    def clean_config(self) -> CleanConfig | None:
        """How the scan is cleaned; None if it is not: a known frame is cleaned only with settings."""
        if isinstance(self.clean, CleanConfig):
            return self.clean
        return CleanConfig() if self.clean and not self.known else None


def sensor_positions(sensor: np.ndarray | None) -> np.ndarray | None:
    """List positions (S, 3) where the scanner stood, of one or several; None where they are not known.

    Raises:
        ConfigError: they are not finite numbers in threes.
    """
    if sensor is None:
        return None
    places = np.atleast_2d(np.asarray(sensor, dtype=np.float64))
    if places.ndim != 2 or places.shape[1] != 3 or not len(places) or not np.isfinite(places).all():
        raise ConfigError(f"sensor must be one or several places of 3 finite numbers each, but is {sensor}.")
    return places
