"""Peers that deform by cages. Neither has a retrieval of its own: both are given the truly nearest sources."""

from __future__ import annotations

from dataclasses import dataclass

import torch
from torch import Tensor

from kpred.evaluation.methods.method import Explanation, Searcher
from kpred.evaluation.methods.sources import Sources
from kpred.fitting import RefineConfig
from kpred.fitting.candidates import Candidates
from kpred.nn.keypoints import thinned
from kpred.ops import icosphere, mean_value_coordinates
from kpred.peers.methods.peer_method import CHUNK, PeerMethod, nearest_undeformed
from kpred.peers.networks.keypoint_deformer import KeypointDeformer
from kpred.peers.networks.neural_cages import NeuralCages


@dataclass(frozen=True)
class KeypointDeformerMethod(PeerMethod[KeypointDeformer]):
    """KeypointDeformer.

    Attributes:
        refinement: this project's keypoint refinement, which the publication does not have; None leaves it out.
    """

    refinement: RefineConfig | None = None

    def over(self, sources: Sources) -> Searcher:
        """See `Method`."""
        return _KeypointDeformer(self.network(sources), sources, self.refinement)


class _KeypointDeformer:
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

    def explain(self, target: Tensor, top_k: int, partial: bool) -> Explanation:
        rows = nearest_undeformed(self.sources, target, top_k, partial)
        errors = self.sources.undeformed_errors(target, partial)
        wanted = self.network.keypoints(thinned(target[None]))
        moved = Candidates(
            model_ids=tuple(self.sources.model_ids[row] for row in rows.tolist()),
            category=self.sources.category,
            distances=errors[rows].numpy(),
            points=self.sources.points[rows],
            basis=self.bases[rows],
            displacement=wanted - self.keypoints[rows],
            target=target,
            confidence=torch.ones(wanted.shape[1]),
            partial=partial,
        )
        if self.refinement is not None:
            moved = moved.refined(self.refinement, torch.arange(len(rows)))
        return Explanation(moved.model_ids, moved.deformed())


@dataclass(frozen=True)
class NeuralCagesMethod(PeerMethod[NeuralCages]):
    """Neural Cages."""

    def over(self, sources: Sources) -> Searcher:
        """See `Method`."""
        return _NeuralCages(self.network(sources), sources)


class _NeuralCages:
    def __init__(self, network: NeuralCages, sources: Sources) -> None:
        self.network, self.sources = network, sources
        made = []
        for points in sources.points.split(CHUNK):
            codes = network.encode(thinned(points))
            cage = network.cage(codes)
            made.append((codes, cage, network.coordinates(points, cage)))
        self.codes, self.cages, self.weights = (torch.cat(parts) for parts in zip(*made, strict=True))

    def explain(self, target: Tensor, top_k: int, partial: bool) -> Explanation:
        rows = nearest_undeformed(self.sources, target, top_k, partial)
        wanted = self.network.encode(thinned(target[None])).expand(len(rows), -1)
        motion = self.network.motion(self.codes[rows], wanted, self.cages[rows])
        moved = self.sources.points[rows] + self.weights[rows] @ motion
        return Explanation(tuple(self.sources.model_ids[row] for row in rows.tolist()), moved)
