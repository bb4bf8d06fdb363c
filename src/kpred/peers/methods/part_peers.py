"""Peers that move and resize parts, and retrieve by what they learned."""

from __future__ import annotations

from dataclasses import dataclass
from weakref import WeakKeyDictionary

import torch
from torch import Tensor
from torch.nn import functional

from kpred.evaluation.methods.method import Searcher
from kpred.evaluation.methods.sources import Sources
from kpred.nn.keypoints import thinned
from kpred.peers.methods.peer_method import CHUNK, Deformed, PeerMethod, PeerSearcher
from kpred.peers.networks.part_boxes import PartBoxes
from kpred.peers.networks.pointnet import POINT_FEATURES
from kpred.peers.networks.u_red import URed
from kpred.peers.networks.uy2021 import Uy2021
from kpred.peers.training.part_sources import cut

SCORED_POINTS = 256
"""Points of a target whose residuals to every source U-RED predicts."""

SPHERE_SAMPLES = 4
"""Points of the unit sphere that U-RED tries for a partial target, as its published test does."""


@dataclass(frozen=True)
class Uy2021Method(PeerMethod[Uy2021]):
    """Uy et al. 2021: sources nearest by their own regions of the embedding, part boxes moved and resized."""

    def over(self, sources: Sources) -> Searcher:
        """See `Method`."""
        return _Uy2021(self.network(sources), sources)


class _Uy2021(PeerSearcher):
    def __init__(self, network: Uy2021, sources: Sources) -> None:
        self.network, self.sources = network, sources
        self.rows = network.rows(sources.model_ids)
        self.boxes = _boxes(sources, network.config.parts)

    def deform(self, cloud: Tensor, top_k: int, partial: bool) -> Deformed:
        near = self.network.distances(cloud[None], self.rows)[0].argsort(stable=True)[:top_k]
        codes = self.network.encode(cloud[None]).expand(len(near), -1)
        deformed = self.network.deform(codes, self.rows[near], self.sources.points[near], self.boxes.take(near))
        return self.named(near, deformed)


@dataclass(frozen=True)
class URedMethod(PeerMethod[URed]):
    """U-RED: sources with the shortest predicted residuals; a partial target takes the best of a few sphere points."""

    def over(self, sources: Sources) -> Searcher:
        """See `Method`."""
        return _URed(self.network(sources), sources)


class _URed(PeerSearcher):
    def __init__(self, network: URed, sources: Sources) -> None:
        self.network, self.sources = network, sources
        self.boxes = _boxes(sources, network.config.parts)
        codes, parts = [], []
        for rows in torch.arange(len(sources)).split(CHUNK):
            features = network.source_encoder.of_points(sources.points[rows])
            codes.append(network.source_encoder.pooled(features))
            parts.append(network.part_codes(features, self.boxes.take(rows)))
        self.codes, self.parts = torch.cat(codes), torch.cat(parts)
        drawn = torch.randn(SPHERE_SAMPLES, POINT_FEATURES, generator=torch.Generator().manual_seed(sources.seed))
        self.sphere = functional.normalize(drawn, dim=1)

    def deform(self, cloud: Tensor, top_k: int, partial: bool) -> Deformed:
        branch = self.network.partial if partial else self.network.whole
        few = thinned(cloud[None])
        own = branch.encoder(few)
        features = branch.encoder.of_points(few[:, :: max(1, few.shape[1] // SCORED_POINTS)])
        extra = [(sample[None],) for sample in self.sphere] if partial else [()]
        scores = torch.stack(
            [
                torch.cat([URed.score(branch.residual(features, own, code, *more)) for code in self.codes.split(CHUNK)])
                for more in extra
            ]
        )
        near = scores.amin(0).argsort(stable=True)[:top_k]
        boxes = self.boxes.take(near)
        nodes = branch.deformation.describe(self.parts[near], boxes.parts)
        motion = branch.deformation(self.codes[near], own.expand(len(near), -1), nodes, boxes.parts)
        deformed = boxes.moved(self.sources.points[near], motion)
        return self.named(near, deformed)


_BOXES: WeakKeyDictionary[Sources, dict[int, PartBoxes]] = WeakKeyDictionary()
"""Boxes of sources by their number of parts, while the sources are in use: several methods have the same."""


def _boxes(sources: Sources, parts: int) -> PartBoxes:
    known = _BOXES.setdefault(sources, {})
    if parts not in known:
        known[parts] = PartBoxes.stack([cut(item.mesh, item.vertices, item.points, parts) for item in sources.meshes])
    return known[parts]
