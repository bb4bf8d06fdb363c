"""Retrieve, deform, measure: the nearest CAD models by tokens, each deformed to the scan by its stored basis."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import torch
from torch import Tensor

from kpred.database import Database
from kpred.fitting.observation import Observation
from kpred.fitting.refine import RefineConfig, refine_keypoints
from kpred.ops import squared_distances


@dataclass(frozen=True, eq=False)
class Candidates:
    """C retrieved models, deformed to one scan.

    Attributes:
        model_ids: ids in the database; category: theirs; distances: (C,) token distances.
        points: (C, N, 3); basis: (C, N, K); displacement: (C, K, 3) of their keypoints.
        target: (M, 3) the scan in this hypothesis' unit box; confidence: (K,).
        partial: whether only scan-to-model distances count.
    """

    model_ids: tuple[str, ...]
    category: str
    distances: np.ndarray
    points: Tensor
    basis: Tensor
    displacement: Tensor
    target: Tensor
    confidence: Tensor
    partial: bool

    def deformed(self) -> Tensor:
        """S + B d, (C, N, 3)."""
        return self.points + self.basis @ self.displacement

    def errors(self, most: int | None = None) -> Tensor:
        """(C,) CD or, for partial scans, UCD; unit box squared. `most` bounds the points used of each cloud."""
        result, goal = self.deformed(), self.target
        if most is not None:
            result = result[:, :: max(1, result.shape[1] // most)]
            goal = goal[:: max(1, len(goal) // most)]
        goal = goal.expand(len(result), -1, -1)
        forth = squared_distances(goal, result).mean(1)
        return forth if self.partial else forth + squared_distances(result, goal).mean(1)

    def refined(self, config: RefineConfig, rows: Tensor | None = None) -> Candidates:
        """The same candidates, or those of `rows`, with refined keypoints.

        All take a few quick steps on half of the points; those that are then far behind the best stop there.
        """
        kept = self if rows is None else self.take(rows)
        if len(kept.model_ids) <= config.finalists:
            return kept.with_displacement(kept._refine(config))
        started = kept.with_displacement(kept._refine(replace(config, iterations=3, points=config.points // 2)))
        ahead = started.errors(most=512).argsort()[: config.finalists]
        displacement = started.displacement.clone()
        displacement[ahead] = started.take(ahead)._refine(config, kept.displacement[ahead])
        return kept.with_displacement(displacement)

    def _refine(self, config: RefineConfig, prior: Tensor | None = None) -> Tensor:
        return refine_keypoints(
            self.points, self.basis, self.displacement, self.target, self.confidence, config, self.partial, prior
        )

    def take(self, rows: Tensor) -> Candidates:
        """The candidates of these rows, in their order."""
        chosen = rows.tolist()
        return Candidates(
            tuple(self.model_ids[row] for row in chosen),
            self.category,
            self.distances[chosen],
            self.points[rows],
            self.basis[rows],
            self.displacement[rows],
            self.target,
            self.confidence,
            self.partial,
        )

    def with_displacement(self, displacement: Tensor) -> Candidates:
        """The same candidates, moved otherwise."""
        values = {**self.__dict__, "displacement": displacement}
        return Candidates(**values)


def retrieve(
    observation: Observation, hypothesis: int, database: Database, category: str, top_k: int, partial: bool
) -> Candidates:
    """The `top_k` models nearest by weighted token distance, deformed by the observed keypoints.

    Raises:
        DatabaseError: if the database has no models of the category.
    """
    found = database.search(
        category,
        observation.tokens[hypothesis].numpy(),
        weights=observation.weights[hypothesis].numpy(),
        top_k=top_k,
    )
    arrays = database.candidates(category, found.model_ids)
    return Candidates(
        model_ids=found.model_ids,
        category=category,
        distances=np.asarray(found.distances),
        points=torch.from_numpy(arrays.points),
        basis=torch.from_numpy(arrays.point_basis),
        displacement=observation.keypoints[hypothesis] - torch.from_numpy(arrays.keypoints),
        target=observation.points[hypothesis],
        confidence=observation.confidence[hypothesis],
        partial=partial,
    )
