"""The baseline without learning: the truly nearest sources, deformed by keypoints that need no network."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
import torch
from torch import Tensor

from kpred.evaluation.methods.method import NO_MODEL, Prediction, Query, Searcher
from kpred.evaluation.methods.sources import Sources
from kpred.evaluation.metrics.cloud_errors import CHUNK
from kpred.fitting.candidates import Candidates
from kpred.ops import (
    enclosing_cage,
    farthest_point_sampling,
    gaussian_influence,
    icosphere,
    mean_value_coordinates,
)
from kpred.ops.typing import Float
from kpred.refinement.config import RefineConfig

NO_LEARNING = "no_learning"

KEYPOINTS = 12
_BUILD_CHUNK = 16


@dataclass(frozen=True)
class NoLearningMethod:
    """The baseline without learning.

    Attributes:
        refinement: of the keypoints, from no displacement; progress: called with the number of prepared sources.
    """

    refinement: RefineConfig = field(default_factory=RefineConfig)
    progress: Callable[[int], None] | None = None
    name: str = NO_MODEL

    @property
    def provenance(self) -> dict[str, Any]:
        """See `Method`."""
        return {}

    def over(self, sources: Sources) -> Searcher:
        """See `Method`."""
        bases = NoLearning.build(sources.model_ids, sources.category, sources.points, self.progress)
        return _Searcher(sources, bases, self.refinement)


@dataclass(frozen=True, eq=False)
class _Searcher:
    sources: Sources
    bases: NoLearning
    refinement: RefineConfig

    def predict(self, query: Query) -> Iterator[Prediction]:
        errors = self.sources.undeformed_errors(query.cloud, query.partial)
        count = len(self.sources) if query.oracle else max(query.top_k)
        unmoved = self.bases.candidates(query.cloud, errors, errors.argsort(stable=True)[:count], query.partial)
        for k in query.top_k:
            # The best few alone are refined to the end, as in a fit.
            first = torch.arange(min(k, len(unmoved.points)))
            yield lowest_error(NO_LEARNING, unmoved.refined(self.refinement, first), k)
        if query.oracle:
            yield best_of_all(f"oracle_{NO_LEARNING}", unmoved, self.refinement)


@dataclass(frozen=True, eq=False)
class NoLearning:
    """Database shapes with a deformation basis that needs no network.

    12 farthest points are the keypoints, their influence on an enclosing cage is a normalised Gaussian, the cage moves
    the shape by mean value coordinates. There are no keypoints of the target: refinement starts from no displacement.

    Attributes:
        model_ids: M ids; category: theirs.
        points: (M, N, 3) unit box; basis: (M, N, 12), S' = S + basis @ displacement.
    """

    model_ids: tuple[str, ...]
    category: str
    points: Tensor
    basis: Tensor

    @classmethod
    def build(
        cls,
        model_ids: tuple[str, ...],
        category: str,
        points: Float[Tensor, "models points 3"],
        progress: Callable[[int], None] | None = None,
    ) -> NoLearning:
        """Compute the bases of all shapes; `progress` is called with the number of finished shapes."""
        faces = icosphere()[1]
        bases: list[Tensor] = []
        for shapes in points.split(_BUILD_CHUNK):
            index = farthest_point_sampling(shapes, KEYPOINTS)
            keypoints = torch.gather(shapes, 1, index[..., None].expand(-1, -1, 3))
            cage = enclosing_cage(shapes)
            weights = mean_value_coordinates(shapes, cage, faces)
            bases.append(weights @ gaussian_influence(keypoints, cage).transpose(1, 2))
            if progress is not None:
                progress(sum(map(len, bases)))
        return cls(model_ids, category, points, torch.cat(bases))

    def candidates(self, target: Tensor, distances: Tensor, rows: Tensor, partial: bool) -> Candidates:
        """Make candidates of the shapes of `rows`, not moved yet; `distances`: (M,) undeformed errors."""
        chosen = rows.tolist()
        return Candidates(
            model_ids=tuple(self.model_ids[row] for row in chosen),
            category=self.category,
            distances=np.asarray(distances.numpy()[chosen]),
            points=self.points[rows],
            basis=self.basis[rows],
            displacement=torch.zeros(len(chosen), KEYPOINTS, 3),
            target=target,
            confidence=torch.ones(KEYPOINTS),
            partial=partial,
        )


def lowest_error(method: str, candidates: Candidates, top_k: int | None) -> Prediction:
    """Choose the candidate of the lowest error, as the published protocol does."""
    errors = candidates.errors()
    row = int(errors.argmin())
    return Prediction(method, top_k, candidates.model_ids[row], candidates.deformed()[row], float(errors[row]))


def best_of_all(method: str, candidates: Candidates, refinement: RefineConfig | None) -> Prediction:
    """Choose the candidate of the lowest error, each refined to the end; without refinement, as they are."""
    complete = None if refinement is None else replace(refinement, finalists=CHUNK)
    parts = torch.arange(len(candidates.points)).split(CHUNK)
    found = [
        lowest_error(method, candidates.take(rows) if complete is None else candidates.refined(complete, rows), None)
        for rows in parts
    ]
    return min(found, key=lambda one: one.error or 0.0)
