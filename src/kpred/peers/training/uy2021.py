"""Training of Uy et al. 2021: retrieval and deformation together, each teaching the other."""

from __future__ import annotations

import torch
from torch import Tensor

from kpred.ops import chamfer_distance
from kpred.peers.networks.uy2021 import Uy2021
from kpred.peers.training.config import Uy2021Training
from kpred.peers.training.part_sources import PartSources
from kpred.peers.training.standardise import hidden_layers, standardise
from kpred.training.data import TrainingData
from kpred.training.single_stage import SingleStage

START_BATCH = 64
"""Targets by which layers are scaled before the first step."""

RETRIEVAL_POINTS = 512
"""Points of a target that the retrieval's encoder sees when it draws candidates from all sources."""


class Uy2021Stage(SingleStage[Uy2021Training]):
    """L_def of the candidates, weighted by the odds that they are retrieved, and L_emb, which draws the odds to
    those by the errors.

    The publication has the L1 difference of both odds, whose gradient is lost where odds are nearly certain; here it is
    their cross-entropy, which is least at the same odds.
    """

    name = "uy2021"

    def __init__(self, network: Uy2021, data: TrainingData, sources: PartSources, config: Uy2021Training) -> None:
        self.network, self.data, self.sources, self.config = network, data, sources, config
        self.everyone = torch.arange(len(sources.model_ids), device=data.device)

    def start(self) -> None:
        """Scale the layers that see shapes."""
        if not self.config.scaled_start:
            return
        network = self.network
        generator = torch.Generator(self.data.device).manual_seed(self.config.seed)
        layers = hidden_layers(network.target_encoder, network.retrieval_encoder, network.decoder)
        standardise(layers, lambda: self._losses(0, START_BATCH, generator))

    def losses(self, step: int, generator: torch.Generator) -> dict[str, Tensor]:
        """Compute the loss terms of one batch of targets, each with several sources."""
        return self._losses(step, self.settings.batch, generator)

    def _losses(self, step: int, batch: int, generator: torch.Generator) -> dict[str, Tensor]:
        config, network = self.config, self.network
        target = self.data.draw_targets(batch, config.points, config.stretch, generator)
        rows = self._candidates(step, target, generator)
        flat, count = rows.flatten(), rows.shape[1]
        codes = network.encode(target).repeat_interleave(count, 0)
        deformed = network.deform(codes, flat, *self.sources.some(flat, config.points))
        error = chamfer_distance(target.repeat_interleave(count, 0), deformed).view(batch, count)
        distance = network.distances(target, self.everyone).gather(1, rows)
        odds = torch.log_softmax(-distance, dim=1)
        known = error.detach()
        scale = config.temperature * known.mean(1, keepdim=True) + 1e-9
        wanted = torch.softmax(-(known - known.amin(1, keepdim=True)) / scale, dim=1)
        # What is likely to be retrieved counts more; the rest still counts, as the odds may be wrong.
        weight = 0.5 * (odds.detach().exp() + 1 / count)
        return {
            "deformation": (weight * error).sum(1).mean(),
            "retrieval": config.retrieval_weight * -(wanted * odds).sum(1).mean(),
        }

    @torch.no_grad()
    def _candidates(self, step: int, target: Tensor, generator: torch.Generator) -> Tensor:
        """Return choose rows of sources (batch, candidates)."""
        count, batch, sources = self.config.candidates, len(target), len(self.everyone)
        rows = torch.randint(0, sources, (batch, count), generator=generator, device=target.device)
        if step < self.config.warmup:
            return rows
        odds = torch.softmax(-self.network.distances(target[:, :RETRIEVAL_POINTS], self.everyone).float(), dim=1)
        drawn = torch.multinomial(odds, count // 2, replacement=True, generator=generator)
        return torch.cat([drawn, rows[:, count // 2 :]], dim=1)
