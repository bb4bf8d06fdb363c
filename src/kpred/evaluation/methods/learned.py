"""KP-RED as a method: retrieval by tokens, deformation by keypoints, with or without refinement."""

from __future__ import annotations

from dataclasses import dataclass

import torch
from torch import Tensor

from kpred.database import Database
from kpred.evaluation.methods.method import Explanation, Searcher
from kpred.evaluation.methods.sources import Sources
from kpred.fitting import RefineConfig
from kpred.fitting.candidates import retrieve
from kpred.fitting.choice import order
from kpred.fitting.observation import observe
from kpred.nn import KPRed, Model


@dataclass(frozen=True)
class KpRedMethod:
    """Trained networks of this package, of any preset; what is measured is what `kpred.fit` does in the known frame.

    Attributes:
        refinement: how keypoints are refined; None measures the networks' own keypoints (the published protocol).
    """

    name: str
    model: Model
    refinement: RefineConfig | None = None
    ranked: bool = True

    def over(self, sources: Sources) -> Searcher:
        """See `Method`."""
        network = self.model[sources.category]
        return _KpRed(network, sources.database(self.model), sources.category, self.refinement)


@dataclass(frozen=True)
class _KpRed:
    network: KPRed
    database: Database
    category: str
    refinement: RefineConfig | None

    def explain(self, target: Tensor, top_k: int, partial: bool) -> Explanation:
        observation = observe(target[None], self.network, partial)
        found = retrieve(observation, 0, self.database, self.category, top_k, partial)
        if self.refinement is None:
            return Explanation(found.model_ids, found.deformed())
        refined = found.refined(self.refinement, torch.arange(len(found.model_ids)))
        # A refined partial scan's result is chosen as a fit chooses it.
        return Explanation(
            refined.model_ids,
            refined.deformed(),
            lambda errors: order(refined.take(torch.arange(len(errors))), errors)[0],
        )
