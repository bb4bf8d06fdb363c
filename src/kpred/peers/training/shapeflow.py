"""Training of ShapeFlow: pairs of shapes flow to the hub, and on to each other."""

from __future__ import annotations

import torch
from torch import Tensor

from kpred.ops import chamfer_distance
from kpred.peers.networks.shapeflow import ShapeFlow
from kpred.peers.training.config import ShapeFlowTraining
from kpred.training.data import TrainingData
from kpred.training.single_stage import SingleStage


class ShapeFlowStage(SingleStage[ShapeFlowTraining]):
    """The Chamfer distance both ways, of codes and flow together; one shape of every pair is a source."""

    name = "shapeflow"

    def __init__(self, network: ShapeFlow, data: TrainingData, config: ShapeFlowTraining) -> None:
        self.network, self.data, self.config = network, data, config

    def losses(self, step: int, generator: torch.Generator) -> dict[str, Tensor]:
        """Compute the loss of one batch of pairs."""
        data, batch = self.data, self.settings.batch
        source = data.sources[data.draw_sources(batch, generator)]
        target = torch.randint(0, len(data.targets), (batch,), generator=generator, device=data.device)
        rows = torch.cat([source, target])
        clouds = data.clouds(rows, self.config.points, generator)
        codes = self.network.code(rows)
        hub = self.network.to_hub(clouds, codes)
        # Each goes on to the other of its pair.
        flown = self.network.from_hub(hub, codes.roll(batch, 0))
        return {"similarity": chamfer_distance(clouds.roll(batch, 0), flown).mean()}
