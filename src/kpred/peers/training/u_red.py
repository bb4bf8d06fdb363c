"""Training of U-RED: random sources, whole and partial targets, and the residuals that the deformation leaves."""

from __future__ import annotations

import torch
from torch import Tensor
from torch.nn import functional

from kpred.ops import chamfer_distance, nearest_neighbours
from kpred.peers.networks.u_red import Branch, URed
from kpred.peers.training.config import URedTraining
from kpred.peers.training.part_sources import PartSources
from kpred.training.augmentation import random_slices
from kpred.training.data import TrainingData
from kpred.training.single_stage import SingleStage


class URedStage(SingleStage[URedTraining]):
    """Chamfer distance, its mirrored twin, consistency of both branches, residuals, reconstruction."""

    name = "u-red"

    def __init__(self, network: URed, data: TrainingData, sources: PartSources, config: URedTraining) -> None:
        self.network, self.data, self.sources, self.config = network, data, sources, config

    def losses(self, step: int, generator: torch.Generator) -> dict[str, Tensor]:
        """Compute the loss terms of one batch of targets, each whole and partial, with one source."""
        config, network, data, batch = self.config, self.network, self.data, self.settings.batch
        target = data.draw_targets(batch, config.points, config.stretch, generator)
        seen = random_slices(target, config.occlusion, generator)
        rows = torch.randint(0, len(self.sources.model_ids), (batch,), generator=generator, device=data.device)
        points, boxes = self.sources.some(rows, config.points)
        features = network.source_encoder.of_points(points)
        code, parts = network.source_encoder.pooled(features), network.part_codes(features, boxes)
        losses = {"reconstruction": _cloud_error(network.source_reconstruction(features, code), points)}
        results, whole_code = [], code
        branch: Branch
        for branch, cloud in ((network.whole, target), (network.partial, seen)):
            features = branch.encoder.of_points(cloud)
            own = branch.encoder.pooled(features)
            result = boxes.moved(points, branch.deformation(code, own, parts, boxes.parts))
            shared = [own, code] if branch is network.whole else [own, code, functional.normalize(whole_code, dim=1)]
            residual = branch.residual(features, *shared)
            whole_code = own if branch is network.whole else whole_code
            results.append(result)
            terms = {
                "similarity": chamfer_distance(target, result).mean(),
                "mirrored": config.mirror_weight * chamfer_distance(target, _mirrored(result)).mean(),
                "residual": config.residual_weight * residual_error(cloud, result.detach(), residual),
                "reconstruction": _cloud_error(branch.reconstruction(features, own), cloud),
            }
            for name, value in terms.items():
                losses[name] = losses[name] + value if name in losses else value
        losses["reconstruction"] = config.reconstruction_weight * losses["reconstruction"]
        losses["consistency"] = config.consistency_weight * _cloud_error(*results)
        return losses


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
