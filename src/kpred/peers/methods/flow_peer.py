"""ShapeFlow as a method: a target gets a code, sources those with the nearest codes, whose flow is then tuned."""

from __future__ import annotations

import copy
from collections.abc import Callable
from dataclasses import dataclass, field

import torch
from torch import Tensor

from kpred.errors import ConfigError
from kpred.evaluation.methods.method import Searcher
from kpred.evaluation.methods.sources import Sources
from kpred.ops import chamfer_distance, unilateral_chamfer_distance
from kpred.peers.methods.peer_method import CHUNK, Deformed, PeerMethod, PeerSearcher
from kpred.peers.networks.shapeflow import ShapeFlow


@dataclass(frozen=True)
class Descent:
    """How a target is fitted, by Adam.

    Attributes:
        points: of target and sources in a step.
        guides: random sources that flow to the target in each step of the search for its code (4, published).
        steps, rate: of that search (30 steps, published).
        tuned: sources with the nearest codes, which all flow to the target in a step of the tuning (5, published).
        tuning_steps, tuning_rate: of code and network together (30 and 0.001, published); without steps the network
            stays as it is.
    """

    points: int = 256
    guides: int = 4
    steps: int = 40
    rate: float = 0.05
    tuned: int = 10
    tuning_steps: int = 30
    tuning_rate: float = 1e-3

    def __post_init__(self) -> None:
        if min(self.points, self.guides, self.steps, self.tuned) < 1 or self.tuning_steps < 0:
            raise ConfigError("points, guides, steps and tuned must be at least 1, tuning_steps at least 0.")


@dataclass(frozen=True)
class ShapeFlowMethod(PeerMethod[ShapeFlow]):
    """ShapeFlow; every target has its own descent, on its code and then on a copy of the network.

    Attributes:
        descent: its settings.
    """

    descent: Descent = field(default_factory=Descent)

    def over(self, sources: Sources) -> Searcher:
        """See `Method`."""
        return _ShapeFlow(self.network(sources), sources, self.descent)


class _ShapeFlow(PeerSearcher):
    def __init__(self, network: ShapeFlow, sources: Sources, descent: Descent) -> None:
        self.network, self.sources, self.descent = network, sources, descent
        self.codes = network.code(network.rows(sources.model_ids))
        # The way to the hub is the same whatever the target.
        pairs = zip(sources.points.split(CHUNK), self.codes.split(CHUNK), strict=True)
        self.hub = torch.cat([network.to_hub(points, codes) for points, codes in pairs])

    def deform(self, cloud: Tensor, top_k: int, partial: bool) -> Deformed:
        # The bench runs without gradients; what was made there cannot take part in them, but copies can.
        with torch.inference_mode(False), torch.enable_grad():
            fit = _Fit(self.descent, cloud.clone(), partial, self.sources.seed)
            code = fit.code_of(self.network, self.hub.clone())
            near = (self.codes.clone() - code).square().sum(1).argsort(stable=True)
            network, code = fit.tuned(self.network, self.hub.clone()[near[: self.descent.tuned]], code)
        near = near[:top_k]
        flown = network.from_hub(self.hub[near], code.expand(len(near), -1))
        return self.named(near, flown)


class _Fit:
    """The descent of one target."""

    def __init__(self, descent: Descent, cloud: Tensor, partial: bool, seed: int) -> None:
        self.descent, self.cloud = descent, cloud
        self.distance = unilateral_chamfer_distance if partial else chamfer_distance
        self.generator = torch.Generator().manual_seed(seed)

    def code_of(self, network: ShapeFlow, hub: Tensor) -> Tensor:
        """Find the code (size,) under which random sources, carried to the hub, flow to the target best."""
        descent = self.descent
        # As published: nearly at the hub.
        code = (1e-4 * torch.randn(network.config.code_size, generator=self.generator)).requires_grad_()

        def error() -> Tensor:
            rows = torch.randint(0, len(hub), (descent.guides,), generator=self.generator)
            return self._error(network, hub[rows], code)

        self._descend([code], descent.steps, descent.rate, error)
        return code.detach()

    def tuned(self, network: ShapeFlow, hub: Tensor, code: Tensor) -> tuple[ShapeFlow, Tensor]:
        """Tune code and a copy of the network on the way of some sources from the hub to the target."""
        if not self.descent.tuning_steps:
            return network, code
        own, code = copy.deepcopy(network), code.clone().requires_grad_()
        weights = [weight.requires_grad_() for name, weight in own.named_parameters() if name != "codes"]
        steps, rate = self.descent.tuning_steps, self.descent.tuning_rate
        self._descend([code, *weights], steps, rate, lambda: self._error(own, hub, code))
        return own.requires_grad_(False), code.detach()

    def _error(self, network: ShapeFlow, hub: Tensor, code: Tensor) -> Tensor:
        flown = network.from_hub(self._some(hub), code.expand(len(hub), -1))
        return self.distance(self._some(self.cloud[None]).expand(len(hub), -1, -1), flown).mean()

    def _some(self, clouds: Tensor) -> Tensor:
        """Draw the same number of points of clouds anew."""
        order = torch.randperm(clouds.shape[1], generator=self.generator)
        return clouds[:, order[: self.descent.points]]

    @staticmethod
    def _descend(variables: list[Tensor], steps: int, rate: float, error: Callable[[], Tensor]) -> None:
        optimizer = torch.optim.Adam(variables, lr=rate)
        for step in range(steps):
            for group in optimizer.param_groups:
                group["lr"] = rate * (1 - step / steps)
            optimizer.zero_grad()
            error().backward()
            optimizer.step()
