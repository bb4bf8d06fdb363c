"""Training of Uy et al. 2021: retrieval and deformation together, each teaching the other."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import torch
from torch import Tensor

from kpred.nn.peers.uy2021 import Uy2021
from kpred.ops import chamfer_distance
from kpred.training.config import StageConfig
from kpred.training.data import TrainingData
from kpred.training.peers.config import Uy2021Training
from kpred.training.peers.part_sources import PartSources

RETRIEVAL_POINTS = 512
"""Points of a target that the retrieval's encoder sees when it draws candidates from all sources."""


class Uy2021Stage:
    """L_def of the candidates, weighted by the odds that they are retrieved, and L_emb = |odds - odds by error|."""

    name = "uy2021"

    def __init__(self, network: Uy2021, data: TrainingData, sources: PartSources, config: Uy2021Training) -> None:
        self.network, self.data, self.sources, self.config = network, data, sources, config
        self.everyone = torch.arange(len(sources.model_ids), device=data.device)

    @property
    def settings(self) -> StageConfig:
        """The optimisation settings."""
        return self.config.optimisation

    def model_config(self) -> dict[str, Any]:
        """The network's config."""
        return self.network.config.to_dict()

    def parameters(self) -> Iterator[torch.nn.Parameter]:
        """Networks and codes."""
        return self.network.parameters()

    def start(self) -> None:
        """Nothing to do."""

    def losses(self, step: int, generator: torch.Generator) -> dict[str, Tensor]:
        """Loss terms of one batch of targets, each with several sources."""
        config, network, batch = self.config, self.network, self.settings.batch
        target = self.data.draw_targets(batch, config.points, config.stretch, generator)
        rows = self._candidates(step, target, generator)
        flat, count = rows.flatten(), rows.shape[1]
        codes = network.encode(target).repeat_interleave(count, 0)
        boxes = self.sources.boxes.take(flat)
        few = slice(0, config.points)
        boxes = type(boxes)(boxes.labels[:, few], boxes.relative[:, few], boxes.parts, boxes.projection)
        deformed = network.deform(codes, flat, self.sources.points[flat, few], boxes)
        error = chamfer_distance(target.repeat_interleave(count, 0), deformed).view(batch, count)
        distance = network.distances(target, self.everyone).gather(1, rows)
        odds = torch.softmax(-distance, dim=1)
        known = error.detach()
        scale = config.temperature * known.mean(1, keepdim=True) + 1e-9
        wanted = torch.softmax(-(known - known.amin(1, keepdim=True)) / scale, dim=1)
        # What is likely to be retrieved counts more; the rest still counts, as the odds may be wrong.
        weight = 0.5 * (odds.detach() + 1 / count)
        return {
            "deformation": (weight * error).sum(1).mean(),
            "retrieval": config.retrieval_weight * (odds - wanted).abs().sum(1).mean(),
        }

    @torch.no_grad()
    def _candidates(self, step: int, target: Tensor, generator: torch.Generator) -> Tensor:
        """(batch, candidates) rows of sources."""
        count, batch, sources = self.config.candidates, len(target), len(self.everyone)
        rows = torch.randint(0, sources, (batch, count), generator=generator, device=target.device)
        if step < self.config.warmup:
            return rows
        odds = torch.softmax(-self.network.distances(target[:, :RETRIEVAL_POINTS], self.everyone).float(), dim=1)
        drawn = torch.multinomial(odds, count // 2, replacement=True, generator=generator)
        return torch.cat([drawn, rows[:, count // 2 :]], dim=1)
