"""What all measurements of whole fits have in common: settings of a fit, a try, and what a fit says about itself."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, fields
from typing import Any, ClassVar, TypeVar

import numpy as np
import trimesh

from kpred.database import Database
from kpred.errors import KpredError
from kpred.evaluation.metrics.summary import ALL
from kpred.fitting import Fit
from kpred.fitting.pipeline import fit
from kpred.json_output import plain
from kpred.nn import Model
from kpred.ops import Frame

Outcome = TypeVar("Outcome", bound="FitOutcome")

YAW_RIGHT = 15.0
"""Degrees."""


@dataclass(frozen=True, eq=False)
class FitSettings:
    """How scans are fitted: the networks, the database, the number of candidates, the seed of sampling."""

    model: Model
    database: Database
    top_k: int
    seed: int


@dataclass(frozen=True)
class FailedFit:
    """A scan without a result; `reason` is one sentence."""

    reason: str


@dataclass(frozen=True, eq=False, kw_only=True)
class FitOutcome:
    """What became of one scan.

    Attributes:
        category: of the true shape; failure: why there is no result.
        found: category of the result; model: id of its model.
        confidence: of the result, None where there is none; warnings: number of its warnings.
        milliseconds: of the fit.
    """

    category: str
    failure: str | None = None
    found: str | None = None
    model: str | None = None
    confidence: float | None = None
    warnings: int = 0
    milliseconds: float | None = None

    PICTURES: ClassVar[tuple[str, ...]] = ("result", "tile")
    """Attributes that JSON leaves out."""

    @property
    def category_right(self) -> bool:
        """Whether the result is of the true category."""
        return self.found == self.category

    def facts(self) -> dict[str, Any]:
        """Return what JSON adds to the attributes."""
        return {}

    def to_json(self) -> dict[str, Any]:
        """Return plain values, without meshes and pictures."""
        values = {one.name: getattr(self, one.name) for one in fields(self) if one.name not in self.PICTURES}
        return {str(key): value for key, value in plain(values | self.facts()).items()}


def try_fit(points: np.ndarray, settings: FitSettings, **options: Any) -> Fit | FailedFit:
    """Fit a scan, or say why there is no result."""
    try:
        return fit(points, settings.model, settings.database, top_k=settings.top_k, seed=settings.seed, **options)
    except KpredError as error:
        return FailedFit(" ".join(str(error).split()))
    except Exception as error:  # One target must not cost the others their results.
        return FailedFit(f"unexpected {type(error).__name__}: {' '.join(str(error).split())}")


def by_category(outcomes: Sequence[Outcome]) -> Iterator[tuple[str, list[Outcome]]]:
    """Group outcomes by true category, sorted; where there are several, the group of all comes last."""
    categories = sorted({outcome.category for outcome in outcomes})
    for category in categories:
        yield category, [outcome for outcome in outcomes if outcome.category == category]
    if len(categories) > 1:
        yield ALL, list(outcomes)


def known_values(outcomes: Iterable[object], name: str) -> list[float]:
    """List the values of an attribute, of those that have one."""
    return [value for one in outcomes if (value := getattr(one, name)) is not None]


def claims(found: Fit) -> dict[str, Any]:
    """Return what a fit says about itself, by the names of `FitOutcome`'s attributes."""
    return {
        "found": found.category,
        "model": found.source.model_id,
        "confidence": float(found.confidence),
        "warnings": len(found.warnings),
        "milliseconds": 1000 * sum(found.timings.values()),
    }


def moved(mesh: trimesh.Trimesh, frame: Frame) -> trimesh.Trimesh:
    """Take a mesh from the scan's frame into the unit box."""
    vertices = frame.to_unit(np.asarray(mesh.vertices, dtype=np.float64))
    return trimesh.Trimesh(vertices, np.asarray(mesh.faces), process=False)
