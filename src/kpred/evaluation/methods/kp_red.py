"""KP-RED as a method: models retrieved by tokens, deformed by keypoints or by structure, as `kpred.fit` does.

Rows, each the best of the first k retrieved:
    undeformed_retrieved   the retrieved models as they are
    feed_forward           deformed by the network's keypoints (the published protocol)
    refined                what `kpred.fit(deform="free")` delivers: keypoints refined
    structure              what `kpred.fit` delivers by default: the simplest explanation that keeps structure
    structure_without_hint the same where the fit itself must find out that nothing is hidden; whole targets alone
    oracle_...             all of the database in place of the retrieved models
The category is given. Each k is a fit of its own. Cleanliness is measured at the largest k.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
import torch

from kpred.evaluation.header import provenance
from kpred.evaluation.methods.method import FEED_FORWARD, REFINED, Prediction, Query, Searcher
from kpred.evaluation.methods.no_learning import best_of_all, lowest_error
from kpred.evaluation.methods.sources import Sources
from kpred.fitting.candidates import Candidates
from kpred.fitting.deform import Deform
from kpred.fitting.explanation import Deformation, ModelPoints
from kpred.fitting.options import FitOptions
from kpred.fitting.selection import rank_candidates
from kpred.fitting.stages import CleanScan, Context, Tried, try_poses
from kpred.fitting.visibility import Visibility
from kpred.fitting.whole_or_partial import deform_readings
from kpred.nn import Model
from kpred.pose.recognition import PoseHypothesis
from kpred.refinement.config import RefineConfig
from kpred.refinement.structure_config import StructureConfig
from kpred.shapes.structure.cleanliness import Cleanliness, measure_cleanliness

RETRIEVED, STRUCTURE, WITHOUT_HINT = "undeformed_retrieved", "structure", "structure_without_hint"


@dataclass(frozen=True, eq=False)
class KpRedMethod:
    """Trained networks of this package, of any preset.

    Attributes:
        name: of the model in tables; model: its networks.
        refinement: of the keypoints; structure: of the structure-keeping deformation.
    """

    name: str
    model: Model
    refinement: RefineConfig = field(default_factory=RefineConfig)
    structure: StructureConfig = field(default_factory=StructureConfig)

    @property
    def provenance(self) -> dict[str, Any]:
        """See `Method`."""
        return provenance(self.model)

    def over(self, sources: Sources) -> Searcher:
        """See `Method`."""
        return _Searcher(self, Context(self.model, sources.database(self.model), (sources.category,)), len(sources))


@dataclass(frozen=True, eq=False)
class _Searcher:
    settings: KpRedMethod
    context: Context
    sources: int

    def predict(self, query: Query) -> Iterator[Prediction]:
        most = self.sources if query.oracle else max(query.top_k)
        found = self._retrieve(query, query.partial, most)
        retrieved = found.best.candidates
        unmoved = replace(retrieved, displacement=torch.zeros_like(retrieved.displacement))
        for k in query.top_k:
            first = torch.arange(min(k, len(retrieved.points)))
            result = lowest_error(RETRIEVED, unmoved.take(first), k)
            if k == max(query.top_k):
                unchanged = self._cleanliness(result.model_id, lambda model: model.points)
                result = replace(result, cleanliness=unchanged)
            yield result
            yield lowest_error(FEED_FORWARD, retrieved.take(first), k)
        yield from self._delivered(query, found, {REFINED: "free", STRUCTURE: "auto"})
        if not query.partial:
            again = self._retrieve(query, None, max(query.top_k))
            yield from self._delivered(query, again, {WITHOUT_HINT: "auto"})
        if query.oracle:
            yield best_of_all(f"oracle_{FEED_FORWARD}", retrieved, None)
            yield best_of_all(f"oracle_{REFINED}", retrieved, self.settings.refinement)

    def _delivered(self, query: Query, found: Tried, rows: dict[str, Deform]) -> Iterator[Prediction]:
        """Yield what fits of each top k deliver by each deformation."""
        for k in query.top_k:
            for method, deform in rows.items():
                retrieved = FitOptions(top_k=k, deform=deform).retrieved
                first = _first(found.best.candidates, retrieved)
                whole = None if found.whole is None else _first(found.whole, retrieved)
                yield self._fit(method, (first, whole), found.visibility, deform, k, k == max(query.top_k))

    def _fit(
        self,
        method: str,
        readings: tuple[Candidates, Candidates | None],
        visibility: Visibility,
        deform: Deform,
        top_k: int,
        clean: bool,
    ) -> Prediction:
        deformed = deform_readings(
            *readings,
            visibility,
            deform,
            refinement=self.settings.refinement,
            structure=self.settings.structure,
            top_k=top_k,
        )
        row = rank_candidates(deformed)[0]
        name, result = deformed.candidates.model_ids[row], deformed.explanations[row]
        cleanliness = self._cleanliness(name, result.deformation) if clean else None
        return Prediction(method, top_k, name, torch.from_numpy(result.points), cleanliness=cleanliness)

    def _retrieve(self, query: Query, hint: bool | None, top_k: int) -> Tried:
        """Encode a target in the known frame, and retrieve models of its category; `hint`: whether it is partial."""
        options = FitOptions(
            top_k=top_k,
            frame="known",
            partial=hint,
            clean=False,
            refinement=self.settings.refinement,
            structure=self.settings.structure,
        )
        scan = CleanScan(query.cloud.double().numpy(), len(query.cloud), "y", None, ())
        return try_poses(scan, [PoseHypothesis(np.eye(3), self.context.categories[0])], self.context, options)

    def _cleanliness(self, model_id: str, deformation: Deformation) -> Cleanliness:
        """Measure what a deformed mesh lost against the model's own."""
        entry = self.context.database.entry(model_id)
        source = entry.frame.to_unit(entry.mesh.vertices.astype(np.float64))
        basis = entry.vertex_basis.astype(np.float64)
        result = deformation(ModelPoints(source, entry.structure.vertex_parts, basis))
        return measure_cleanliness(source, result, np.asarray(entry.mesh.faces), entry.structure)


def _first(candidates: Candidates, count: int) -> Candidates:
    return candidates.take(torch.arange(min(count, len(candidates.points))))
