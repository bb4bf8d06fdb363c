"""ShapeFlow as a method: a code is found for the target, sources are those with the nearest codes."""

from __future__ import annotations

from dataclasses import dataclass

import torch
from torch import Tensor

from kpred.evaluation.methods.method import Searcher
from kpred.evaluation.methods.sources import Sources
from kpred.ops import chamfer_distance, unilateral_chamfer_distance
from kpred.peers.methods.peer_method import CHUNK, Deformed, PeerMethod, PeerSearcher
from kpred.peers.networks.shapeflow import ShapeFlow

POINTS = 256
"""Points of target and sources while the code is sought."""

GUIDES = 8
"""Random sources that are flown to the target in each step of the search."""

STEPS, RATE = 40, 0.05
"""Steps of the search (Adam), and its rate."""


@dataclass(frozen=True)
class ShapeFlowMethod(PeerMethod[ShapeFlow]):
    """ShapeFlow; the network stays as it is, and only the target's code is sought."""

    def over(self, sources: Sources) -> Searcher:
        """See `Method`."""
        return _ShapeFlow(self.network(sources), sources)


class _ShapeFlow(PeerSearcher):
    def __init__(self, network: ShapeFlow, sources: Sources) -> None:
        self.network, self.sources = network, sources
        self.codes = network.code(network.rows(sources.model_ids))
        # The way to the hub is the same whatever the target.
        pairs = zip(sources.points.split(CHUNK), self.codes.split(CHUNK), strict=True)
        self.hub = torch.cat([network.to_hub(points, codes) for points, codes in pairs])

    def deform(self, cloud: Tensor, top_k: int, partial: bool) -> Deformed:
        code = self._sought(cloud, partial)
        near = (self.codes - code).square().sum(1).argsort(stable=True)[:top_k]
        flown = self.network.from_hub(self.hub[near], code.expand(len(near), -1))
        return self.named(near, flown)

    def _sought(self, cloud: Tensor, partial: bool) -> Tensor:
        """Optimise the code (size,) under which random sources flow to the target best."""
        distance = unilateral_chamfer_distance if partial else chamfer_distance
        generator = torch.Generator().manual_seed(self.sources.seed)
        # The bench runs without gradients; what was made there cannot take part in them, but copies can.
        with torch.inference_mode(False), torch.enable_grad():
            goal = cloud[:: max(1, len(cloud) // POINTS)].clone().expand(GUIDES, -1, -1)
            hub = self.hub[:, :: max(1, self.hub.shape[1] // POINTS)].clone()
            code = (1e-4 * torch.randn(self.codes.shape[1], generator=generator)).requires_grad_()
            optimizer = torch.optim.Adam([code], lr=RATE)
            for step in range(STEPS):
                for group in optimizer.param_groups:
                    group["lr"] = RATE * (1 - step / STEPS)
                rows = torch.randint(0, len(hub), (GUIDES,), generator=generator)
                flown = self.network.from_hub(hub[rows], code.expand(GUIDES, -1))
                optimizer.zero_grad()
                distance(goal, flown).mean().backward()
                optimizer.step()
        return code.detach()
