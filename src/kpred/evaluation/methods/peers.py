"""Peers as methods on the bench."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import TypeVar

import numpy as np
import torch
from torch import Tensor

from kpred.errors import ModelError
from kpred.evaluation.methods.method import Explanation, Searcher
from kpred.evaluation.methods.sources import Sources
from kpred.fitting import RefineConfig
from kpred.fitting.candidates import Candidates
from kpred.nn.keypoints import thinned
from kpred.nn.peers.keypoint_deformer import KeypointDeformer
from kpred.nn.peers.part_boxes import PartBoxes
from kpred.nn.peers.uy2021 import Uy2021
from kpred.ops import icosphere, mean_value_coordinates
from kpred.training.peers.part_sources import cut

Network = TypeVar("Network")

CHUNK = 16
"""Sources prepared at once."""


@dataclass(frozen=True)
class KeypointDeformerMethod:
    """KeypointDeformer; it has no retrieval of its own and is given the truly nearest undeformed sources (CD or UCD).

    Attributes:
        networks: by category.
        refinement: this project's keypoint refinement, which the publication does not have; None leaves it out.
    """

    name: str
    networks: Mapping[str, KeypointDeformer]
    refinement: RefineConfig | None = None
    ranked: bool = True

    def over(self, sources: Sources) -> Searcher:
        """See `Method`."""
        return _KeypointDeformer(_network(self.name, self.networks, sources), sources, self.refinement)


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
        errors = self.sources.undeformed_errors(target, partial)
        rows = errors.argsort(stable=True)[:top_k]
        wanted = self.network.keypoints(thinned(target[None]))
        moved = Candidates(
            model_ids=tuple(self.sources.model_ids[row] for row in rows.tolist()),
            category=self.sources.category,
            distances=np.asarray(errors[rows]),
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
class Uy2021Method:
    """Uy et al. 2021: sources nearest by their own regions of the embedding, part boxes moved and resized.

    Attributes:
        networks: by category.
    """

    name: str
    networks: Mapping[str, Uy2021]
    ranked: bool = True

    def over(self, sources: Sources) -> Searcher:
        """See `Method`."""
        return _Uy2021(_network(self.name, self.networks, sources), sources)


class _Uy2021:
    def __init__(self, network: Uy2021, sources: Sources) -> None:
        self.network, self.sources = network, sources
        self.rows = network.rows(sources.model_ids)
        parts = network.config.parts
        self.boxes = PartBoxes.stack([cut(item.mesh, item.vertices, item.points, parts) for item in sources.meshes])

    def explain(self, target: Tensor, top_k: int, partial: bool) -> Explanation:
        near = self.network.distances(target[None], self.rows)[0].argsort(stable=True)[:top_k]
        codes = self.network.encode(target[None]).expand(len(near), -1)
        deformed = self.network.deform(codes, self.rows[near], self.sources.points[near], self.boxes.take(near))
        return Explanation(tuple(self.sources.model_ids[row] for row in near.tolist()), deformed)


def _network(name: str, networks: Mapping[str, Network], sources: Sources) -> Network:
    if sources.category not in networks:
        known = ", ".join(networks)
        raise ModelError(f"{name} knows no category '{sources.category}', only {known}; train it on that category.")
    return networks[sources.category]
