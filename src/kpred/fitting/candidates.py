"""Retrieve, deform, measure: the nearest CAD models by tokens, each deformed to the scan by its stored basis."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
import torch
from torch import Tensor

from kpred.database import Database
from kpred.fitting.encoding import ScanEncoding
from kpred.lru_cache import LruCache
from kpred.ops.chamfer_cpu import chamfer_of_each
from kpred.ops.typing import Float
from kpred.ops.weighted_sums import deformed
from kpred.refinement.config import RefineConfig
from kpred.refinement.free_space import depth_pictures
from kpred.refinement.keypoints import Hints, Refined, refine_candidates
from kpred.refinement.structure_config import StructureConfig
from kpred.refinement.structure_fit import StructureModel
from kpred.refinement.symmetry import reflect
from kpred.shapes.structure import Structure

MAX_MODELS = 256
"""Models that are kept ready for structure-keeping fits: some 700 kB each."""

_models: LruCache[tuple[Structure, StructureConfig], StructureModel] = LruCache(MAX_MODELS)


@dataclass(frozen=True, eq=False)
class Candidates:
    """C retrieved models, deformed to one scan.

    Attributes:
        model_ids: ids in the database; category: theirs; distances: (C,) token distances.
        points: (C, N, 3); basis: (C, N, K); displacement: (C, K, 3) of their keypoints.
        target: (M, 3) the scan in this hypothesis' unit box; confidence: (K,).
        partial: whether only scan-to-model distances count.
        keypoints: (K, 3) that the network expects of the whole object, where a network said so.
        sensors: (S, 3) where the scanner stood, where it is known.
        stopped: (C,) bool, of those that refinement did not carry to the end, if there were more than a few.
        scales: (C,) half the longest side of each model's box in its own unit, if models have one.
        structures: of the models; point_parts: (C, N) part of each point; point_normals: (C, N, 3), outward.
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
    keypoints: Tensor | None = None
    sensors: Tensor | None = None
    stopped: Tensor | None = None
    structures: tuple[Structure, ...] = ()
    point_parts: np.ndarray | None = None
    point_normals: np.ndarray | None = None
    scales: np.ndarray | None = None

    def structure_model(self, row: int, config: StructureConfig) -> StructureModel:
        """Build the structure model of one row, cached in memory."""
        assert self.point_parts is not None and self.point_normals is not None
        key = (self.structures[row], config)
        found = _models.get(key)
        if found is not None:
            return found
        points = self.points[row].numpy().astype(np.float64)
        made = StructureModel.of(self.structures[row], points, self.point_parts[row], self.point_normals[row], config)
        _models.put(key, made)
        return made

    def deformed(self) -> Tensor:
        """Deform points by keypoints: S + B d, (C, N, 3)."""
        return self._deformed

    @cached_property
    def _deformed(self) -> Tensor:
        return deformed(self.points, self.basis, self.displacement)

    def errors(self, max_points: int | None = None) -> Tensor:
        """Compute CD (C,) or, for partial scans, UCD; unit box squared; infinite for stopped candidates.

        `max_points` bounds the queries of each cloud, which are searched among all points of the other.
        """
        rows = torch.arange(len(self.model_ids)) if self.stopped is None else (~self.stopped).nonzero()[:, 0]
        errors = torch.full((len(self.model_ids),), torch.inf)
        errors[rows] = self.errors_of(rows, max_points)
        return errors

    def errors_of(self, rows: Tensor, max_points: int | None = None) -> Tensor:
        """Compute `errors` of these rows, stopped or not."""
        results, target = _rows(self.deformed(), rows), self.target
        steps = [1 if max_points is None else max(1, count // max_points) for count in (results.shape[1], len(target))]
        found = chamfer_of_each(target.contiguous().numpy(), results.numpy(), self.partial, *steps)
        return torch.from_numpy(found)

    def refined(self, config: RefineConfig, rows: Tensor | None = None) -> Candidates:
        """Return the same candidates, or those of `rows`, with refined keypoints.

        All take a few quick steps on some of the points; those that are then far behind the best stop there.
        """
        kept = replace(self if rows is None else self.take(rows), stopped=None)
        hints = kept._hints(config)
        finalists = config.most_finalists(self.partial)
        if len(kept.model_ids) <= finalists:
            return kept._moved(kept._refine(config, hints))
        quick = kept._refine(config.quick(), replace(hints, pictures=()))
        ahead = quick.error.argsort(stable=True)[:finalists]
        final = kept._moved(quick).take(ahead)._refine(config, hints, kept.displacement[ahead])
        displacement = quick.displacement.clone()
        displacement[ahead] = final.displacement
        stopped = torch.ones(len(kept.model_ids), dtype=torch.bool)
        stopped[ahead] = False
        return replace(kept, displacement=displacement, stopped=stopped)

    def _hints(self, config: RefineConfig) -> Hints:
        """Return hints about the unseen part of a partial scan; none for a full one."""
        if not self.partial:
            return Hints()
        sensors = self.sensors if config.free_space > 0 or config.reflection > 0 else None
        pictures = () if sensors is None else tuple(depth_pictures(self.target, sensors))
        if config.reflection <= 0 or self.keypoints is None:
            return Hints(pictures)
        return Hints(pictures, reflect(self.target, self.keypoints, pictures))

    def _refine(self, config: RefineConfig, hints: Hints, prior: Tensor | None = None) -> Refined:
        return refine_candidates(
            self.points, self.basis, self.displacement, self.target, self.confidence, config, self.partial, prior, hints
        )

    def _moved(self, refined: Refined) -> Candidates:
        return replace(self, displacement=refined.displacement)

    def rotated(self, rotation: Float[Tensor, "3 3"]) -> Candidates:
        """Return the candidates for a scan rotated slightly about the middle of its unit box."""
        old = None if self.keypoints is None else self.keypoints @ rotation.T
        moved = self.displacement
        if old is not None and self.keypoints is not None:
            moved = self.displacement + (old - self.keypoints)
        sensors = None if self.sensors is None else self.sensors @ rotation.T
        target = (self.target @ rotation.T).contiguous()
        return replace(self, target=target, keypoints=old, displacement=moved, sensors=sensors)

    def take(self, rows: Tensor) -> Candidates:
        """Select the candidates of these rows, in their order."""
        chosen = rows.tolist()
        return replace(
            self,
            model_ids=tuple(self.model_ids[row] for row in chosen),
            distances=self.distances[chosen],
            points=_rows(self.points, rows),
            basis=_rows(self.basis, rows),
            displacement=self.displacement[rows],
            stopped=None if self.stopped is None else self.stopped[rows],
            structures=tuple(self.structures[row] for row in chosen) if self.structures else (),
            point_parts=None if self.point_parts is None else self.point_parts[chosen],
            point_normals=None if self.point_normals is None else self.point_normals[chosen],
            scales=None if self.scales is None else self.scales[chosen],
        )


def _rows(tensor: Tensor, rows: Tensor) -> Tensor:
    """Copy `tensor[rows]` on the CPU, faster than an index, which would wake torch's threads."""
    return torch.from_numpy(tensor.numpy()[rows.numpy()])


def retrieve_named(candidates: Candidates, database: Database, model_id: str) -> Candidates:
    """Retrieve one named model of the same category, deformed by the same keypoints.

    Raises:
        DatabaseError: if the database has no such model of the category.
    """
    assert candidates.keypoints is not None
    arrays = database.candidates(candidates.category, [model_id])
    return replace(
        candidates,
        model_ids=(model_id,),
        distances=np.zeros(1),
        points=torch.from_numpy(arrays.points),
        basis=torch.from_numpy(arrays.point_basis),
        displacement=candidates.keypoints - torch.from_numpy(arrays.keypoints),
        structures=arrays.structures,
        point_parts=arrays.point_parts,
        point_normals=arrays.point_normals,
        scales=arrays.scales,
    )


def retrieve(
    encoding: ScanEncoding, hypothesis: int, database: Database, category: str, top_k: int, partial: bool
) -> Candidates:
    """Retrieve the `top_k` models nearest by weighted token distance, deformed by the predicted keypoints.

    Raises:
        DatabaseError: if the database has no models of the category.
    """
    found = database.search(
        category,
        encoding.tokens[hypothesis].numpy(),
        weights=encoding.weights[hypothesis].numpy(),
        top_k=top_k,
    )
    arrays = database.candidates(category, found.model_ids)
    return Candidates(
        model_ids=found.model_ids,
        category=category,
        distances=np.asarray(found.distances),
        points=torch.from_numpy(arrays.points),
        basis=torch.from_numpy(arrays.point_basis),
        displacement=encoding.keypoints[hypothesis] - torch.from_numpy(arrays.keypoints),
        target=encoding.points[hypothesis],
        confidence=encoding.confidence[hypothesis],
        partial=partial,
        keypoints=encoding.keypoints[hypothesis],
        structures=arrays.structures,
        point_parts=arrays.point_parts,
        point_normals=arrays.point_normals,
        scales=arrays.scales,
    )
