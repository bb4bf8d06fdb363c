"""Peers that deform by cages. Neither has a retrieval of its own: both are given the truly nearest sources."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import torch
from torch import Tensor

from kpred.evaluation.methods.method import REFINED, Prediction, Query, Searcher, best_of_first
from kpred.evaluation.methods.sources import Sources
from kpred.fitting import RefineConfig
from kpred.fitting.candidates import Candidates
from kpred.nn.keypoints import thinned
from kpred.ops import icosphere, mean_value_coordinates
from kpred.peers.methods.peer_method import CHUNK, Deformed, PeerMethod, PeerSearcher, nearest_undeformed
from kpred.peers.networks.keypoint_deformer import KeypointDeformer
from kpred.peers.networks.neural_cages import NeuralCages


@dataclass(frozen=True)
class KeypointDeformerMethod(PeerMethod[KeypointDeformer]):
    """KeypointDeformer.

    Attributes:
        refinement: of a second row, with this project's keypoint refinement, which the publication does not have.
    """

    refinement: RefineConfig | None = None

    def over(self, sources: Sources) -> Searcher:
        """See `Method`."""
        return _KeypointDeformer(self.network(sources), sources, self.refinement)


class _KeypointDeformer(PeerSearcher):
    def __init__(self, network: KeypointDeformer, sources: Sources, refinement: RefineConfig | None) -> None:
        self.network, self.sources, self.refinement = network, sources, refinement
        faces = icosphere(network.config.cage_subdivisions)[1]
        keypoints, bases = [], []
        for points in sources.points.split(CHUNK):
            found, cage = network.keypoints(thinned(points)), network.cage(points)
            influence = network.influence(network.offset(points), found, cage)
            keypoints.append(found)
            bases.append(mean_value_coordinates(points, cage, faces) @ influence.transpose(1, 2))
        self.keypoints, self.bases = torch.cat(keypoints), torch.cat(bases)

    def deform(self, cloud: Tensor, top_k: int, partial: bool) -> Deformed:
        moved = self._candidates(cloud, top_k, partial)
        return Deformed(moved.model_ids, moved.deformed())

    def predict(self, query: Query) -> Iterator[Prediction]:
        yield from super().predict(query)
        if self.refinement is not None:
            moved = self._candidates(query.cloud, max(query.top_k), query.partial)
            refined = moved.refined(self.refinement, torch.arange(len(moved.model_ids)))
            yield from best_of_first(REFINED, query, refined.model_ids, refined.deformed())

    def _candidates(self, cloud: Tensor, top_k: int, partial: bool) -> Candidates:
        rows = nearest_undeformed(self.sources, cloud, top_k, partial)
        errors = self.sources.undeformed_errors(cloud, partial)
        wanted = self.network.keypoints(thinned(cloud[None]))
        return Candidates(
            model_ids=tuple(self.sources.model_ids[row] for row in rows.tolist()),
            category=self.sources.category,
            distances=errors[rows].numpy(),
            points=self.sources.points[rows],
            basis=self.bases[rows],
            displacement=wanted - self.keypoints[rows],
            target=cloud,
            confidence=torch.ones(wanted.shape[1]),
            partial=partial,
        )


@dataclass(frozen=True)
class NeuralCagesMethod(PeerMethod[NeuralCages]):
    """Neural Cages."""

    def over(self, sources: Sources) -> Searcher:
        """See `Method`."""
        return _NeuralCages(self.network(sources), sources)


class _NeuralCages(PeerSearcher):
    def __init__(self, network: NeuralCages, sources: Sources) -> None:
        self.network, self.sources = network, sources
        made = []
        for points in sources.points.split(CHUNK):
            codes = network.encode(thinned(points))
            cage = network.cage(codes)
            made.append((codes, cage, network.coordinates(points, cage)))
        self.codes, self.cages, self.weights = (torch.cat(parts) for parts in zip(*made, strict=True))

    def deform(self, cloud: Tensor, top_k: int, partial: bool) -> Deformed:
        rows = nearest_undeformed(self.sources, cloud, top_k, partial)
        wanted = self.network.encode(thinned(cloud[None])).expand(len(rows), -1)
        motion = self.network.motion(self.codes[rows], wanted, self.cages[rows])
        moved = self.sources.points[rows] + self.weights[rows] @ motion
        return self.named(rows, moved)
