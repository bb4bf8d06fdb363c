"""KP-RED as a method: retrieval by tokens, deformation by keypoints, with or without refinement, or by structure."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import torch
from torch import Tensor

from kpred.evaluation.methods.method import Explanation, Searcher
from kpred.evaluation.methods.sources import Sources
from kpred.evaluation.tables.known_frame import retrieve_for
from kpred.fitting.deform import Deform, deform_candidates
from kpred.fitting.options import FitOptions
from kpred.fitting.selection import rank_candidates
from kpred.fitting.stages import Context
from kpred.nn import Model


@dataclass(frozen=True)
class KpRedMethod:
    """Trained networks of this package, of any preset; what is measured is what `kpred.fit` does in the known frame.

    Attributes:
        deform: how far models are changed, as `kpred.fit` takes it; `paper` measures the networks' own keypoints and
            takes the lowest error (the published protocol). Otherwise, of fewer candidates than are deformed, the one
            is taken that a fit of all of them ranks highest.
    """

    name: str
    model: Model
    deform: Deform = "paper"
    ranked: bool = True

    def over(self, sources: Sources) -> Searcher:
        """See `Method`."""
        network = self.model[sources.category]
        context = Context(self.model, sources.database(self.model), (network.config.category,))
        return _KpRed(context, self.deform)


@dataclass(frozen=True)
class _KpRed:
    context: Context
    deform: Deform

    def explain(self, target: Tensor, top_k: int, partial: bool) -> Explanation:
        options = FitOptions(top_k=top_k, frame="known", deform=self.deform, partial=partial, clean=False)
        tried = retrieve_for(target, self.context, options)
        candidates = tried.best.candidates
        if self.deform == "paper":
            return Explanation(candidates.model_ids, candidates.deformed())
        deformed = deform_candidates(candidates, tried.visibility, self.deform)
        points = torch.from_numpy(np.stack([one.points for one in deformed.explanations]))
        ranking = rank_candidates(deformed)
        return Explanation(
            candidates.model_ids,
            points,
            # Of the first few, the one that a fit ranks highest.
            lambda errors: next(row for row in ranking if row < len(errors)),
        )
