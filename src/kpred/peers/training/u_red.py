"""Training of U-RED: every source of a step to every target, and the residuals that the deformation leaves."""

from __future__ import annotations

from dataclasses import dataclass

import torch
from torch import Tensor
from torch.nn import functional

from kpred.ops import chamfer_distance, nearest_neighbours
from kpred.ops.typing import Float, Int
from kpred.peers.networks.part_boxes import PartBoxes
from kpred.peers.networks.u_red import Branch, URed
from kpred.peers.training.config import URedTraining
from kpred.peers.training.part_sources import PartSources
from kpred.peers.training.standardise import hidden_layers, standardise
from kpred.training.augmentation import random_slices
from kpred.training.data import TrainingData
from kpred.training.single_stage import SingleStage

START_BATCH = 64
"""Targets by which layers are scaled before the first step."""


@dataclass(frozen=True, eq=False)
class Pairs:
    """Sources of a step, each with each target: first all sources of the first target.

    Attributes:
        target, source: (pairs,) rows; points, code, boxes, parts: of the sources, the last as codes.
    """

    target: Int[Tensor, " pairs"]
    source: Int[Tensor, " pairs"]
    points: Float[Tensor, "sources points 3"]
    code: Float[Tensor, "sources 256"]
    parts: Float[Tensor, "sources parts 256"]
    boxes: PartBoxes

    def deformed(self, branch: Branch, own: Float[Tensor, "batch 256"]) -> Float[Tensor, "pairs points 3"]:
        """Deform each source to each target, given by its code."""
        network, boxes = branch.deformation, self.boxes.take(self.source)
        nodes = network.describe(self.parts, self.boxes.parts)
        motion = network(self.code[self.source], own[self.target], nodes[self.source], boxes.parts)
        return boxes.moved(self.points[self.source], motion)


class URedStage(SingleStage[URedTraining]):
    """Chamfer distance, its mirrored twin, residuals, reconstruction; for the partial branch consistency too."""

    name = "u-red"

    def __init__(self, network: URed, data: TrainingData, sources: PartSources, config: URedTraining) -> None:
        self.network, self.data, self.sources, self.config = network, data, sources, config
        self.partial_step = round(config.whole_fraction * config.optimisation.steps)

    def start(self) -> None:
        """Scale the layers that see shapes; those of the attention itself stay as they are."""
        if not self.config.scaled_start:
            return
        network, whole = self.network, self.network.whole
        attention = whole.deformation
        layers = hidden_layers(
            network.source_encoder,
            network.source_reconstruction,
            whole.encoder,
            whole.residual,
            whole.reconstruction,
            attention.encode,
        )
        generator = torch.Generator(self.data.device).manual_seed(self.config.seed)
        standardise(
            [*layers, attention.source, attention.target, attention.hidden],
            lambda: self._losses(0, START_BATCH, generator),
        )

    def losses(self, step: int, generator: torch.Generator) -> dict[str, Tensor]:
        """Compute the loss terms of one batch: of whole targets, in the last steps of partial ones."""
        return self._losses(step, self.settings.batch, generator)

    def _losses(self, step: int, batch: int, generator: torch.Generator) -> dict[str, Tensor]:
        config, network = self.config, self.network
        target = self.data.draw_targets(batch, config.points, config.stretch, generator)
        if step < self.partial_step:
            pairs, reconstruction = self._pairs(len(target), generator)
            losses, *_ = self._of_branch(network.whole, pairs, target, target)
            losses["reconstruction"] = losses["reconstruction"] + config.reconstruction_weight * reconstruction
            return losses
        if step == self.partial_step:
            network.partial.start_from(network.whole)
        with torch.no_grad():
            pairs, _ = self._pairs(len(target), generator)
            whole_code = network.whole.encoder(target)
            whole_result = pairs.deformed(network.whole, whole_code)
        seen = random_slices(target, config.occlusion, generator)
        losses, result = self._of_branch(network.partial, pairs, seen, target, functional.normalize(whole_code, dim=1))
        losses["consistency"] = config.consistency_weight * _cloud_error(result, whole_result)
        return losses

    def _pairs(self, targets: int, generator: torch.Generator) -> tuple[Pairs, Tensor]:
        """Draw the step's sources; also the error of their reconstruction."""
        config, encoder, device = self.config, self.network.source_encoder, self.data.device
        rows = torch.randint(0, len(self.sources.model_ids), (config.sources,), generator=generator, device=device)
        points, boxes = self.sources.some(rows, config.points)
        features = encoder.of_points(points)
        code = encoder.pooled(features)
        numbers = torch.arange(targets * config.sources, device=device)
        pairs = Pairs(
            target=numbers // config.sources,
            source=numbers % config.sources,
            points=points,
            code=code,
            parts=self.network.part_codes(features, boxes),
            boxes=boxes,
        )
        few = slice(0, config.decoded_points)
        return pairs, _cloud_error(self.network.source_reconstruction(features[:, few], code), points[:, few])

    def _of_branch(
        self, branch: Branch, pairs: Pairs, cloud: Tensor, target: Tensor, *more: Tensor
    ) -> tuple[dict[str, Tensor], Tensor]:
        """Compute the losses of a branch that sees `cloud` of the whole targets, and its results."""
        config = self.config
        features = branch.encoder.of_points(cloud)
        own = branch.encoder.pooled(features)
        result, wanted = pairs.deformed(branch, own), target[pairs.target]
        few = slice(0, config.decoded_points)  # points lie in random order
        codes = [own[pairs.target], pairs.code[pairs.source], *(code[pairs.target] for code in more)]
        residual = branch.residual(features[:, few], *codes, rows=pairs.target)
        rebuilt = branch.reconstruction(features[:, few], own)
        losses = {
            "similarity": chamfer_distance(wanted, result).mean(),
            "mirrored": config.mirror_weight * chamfer_distance(wanted, _mirrored(result)).mean(),
            "residual": config.residual_weight * residual_error(cloud[pairs.target, few], result.detach(), residual),
            "reconstruction": config.reconstruction_weight * _cloud_error(rebuilt, cloud[:, few]),
        }
        return losses, result


def residual_error(target: Tensor, result: Tensor, residual: Tensor) -> Tensor:
    """Compute the mean L1 distance of the target's points, moved by the residuals, to the result."""
    _, index = nearest_neighbours(target, result)
    nearest = torch.gather(result, 1, index[..., None].expand(-1, -1, 3))
    return (target + residual - nearest).abs().sum(2).mean() + 0.01 * residual.abs().sum(2).mean()


def _cloud_error(found: Tensor, wanted: Tensor) -> Tensor:
    """Compute the error of clouds whose points correspond in order."""
    return (found - wanted).square().sum(2).mean()


def _mirrored(points: Tensor) -> Tensor:
    return points * points.new_tensor([-1.0, 1.0, 1.0])
