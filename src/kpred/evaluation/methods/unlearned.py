"""The baselines as methods: sources as they are, and deformation that nobody learned."""

from __future__ import annotations

from dataclasses import dataclass

import torch
from torch import Tensor

from kpred.evaluation.methods.method import Explanation, Searcher
from kpred.evaluation.methods.sources import Sources
from kpred.evaluation.tables.rows import NO_LEARNING, UNDEFORMED
from kpred.fitting import RefineConfig


@dataclass(frozen=True)
class UndeformedMethod:
    """The truly nearest source, not deformed at all."""

    name: str = UNDEFORMED
    ranked: bool = False

    def over(self, sources: Sources) -> Searcher:
        """See `Method`."""
        return _Undeformed(sources)


@dataclass(frozen=True)
class NoLearningMethod:
    """The nearest sources, deformed by `kpred.evaluation.tables.baselines.NoLearning` with keypoint refinement."""

    refinement: RefineConfig = RefineConfig()
    name: str = NO_LEARNING
    ranked: bool = True

    def over(self, sources: Sources) -> Searcher:
        """See `Method`."""
        return _NoLearning(sources, self.refinement)


@dataclass(frozen=True)
class _Undeformed:
    sources: Sources

    def explain(self, target: Tensor, top_k: int, partial: bool) -> Explanation:
        nearest = self.sources.undeformed_errors(target, partial).argmin()
        row = int(nearest)
        return Explanation((self.sources.model_ids[row],), self.sources.points[row : row + 1])


@dataclass(frozen=True)
class _NoLearning:
    sources: Sources
    refinement: RefineConfig

    def explain(self, target: Tensor, top_k: int, partial: bool) -> Explanation:
        errors = self.sources.undeformed_errors(target, partial)
        nearest = errors.argsort(stable=True)[:top_k]
        unmoved = self.sources.baseline.candidates(target, errors, nearest, partial)
        refined = unmoved.refined(self.refinement, torch.arange(len(nearest)))
        return Explanation(refined.model_ids, refined.deformed())
