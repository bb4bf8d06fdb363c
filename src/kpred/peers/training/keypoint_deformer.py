"""Training of KeypointDeformer: random pairs of shapes, similarity, keypoints drawn to farthest points."""

from __future__ import annotations

import torch
from torch import Tensor

from kpred.ops import chamfer_distance, farthest_point_sampling
from kpred.peers.networks.keypoint_deformer import KeypointDeformer
from kpred.peers.training.config import KeypointDeformerTraining
from kpred.training.data import TrainingData
from kpred.training.single_stage import SingleStage

SPREAD_POINTS = 512
"""Points of each cloud among which the farthest are sought."""


class KeypointDeformerStage(SingleStage[KeypointDeformerTraining]):
    """L = L_sim + w_k L_kpt + w_i L_inf of the publication, in the form that the training loop wants."""

    name = "keypoint-deformer"

    def __init__(self, network: KeypointDeformer, data: TrainingData, config: KeypointDeformerTraining) -> None:
        self.network, self.data, self.config = network, data, config

    def losses(self, step: int, generator: torch.Generator) -> dict[str, Tensor]:
        """Compute the loss terms of one random batch of source/target pairs."""
        config, data, network = self.config, self.data, self.network
        batch = self.settings.batch
        target = data.draw_targets(batch, config.points, config.stretch, generator)
        rows = data.draw_sources(batch, generator)
        source, cage = data.points[rows], data.cages[rows]
        both = torch.cat([source, target])
        keypoints = network.keypoints(both)
        losses = {"keypoints": config.keypoint_weight * self._spread(both, keypoints)}
        if step < config.warmup:
            return losses
        source_keypoints, target_keypoints = keypoints.chunk(2)
        offset = network.offset(source)
        influence = network.influence(offset, source_keypoints, cage)
        moved = data.weights[rows].float() @ (influence.transpose(1, 2) @ (target_keypoints - source_keypoints))
        losses["similarity"] = chamfer_distance(target, source + moved).mean()
        losses["offset"] = config.offset_weight * offset.square().mean()
        return losses

    def _spread(self, clouds: Tensor, keypoints: Tensor) -> Tensor:
        few = clouds[:, :SPREAD_POINTS]
        index = farthest_point_sampling(few, self.config.spread_samples)
        return chamfer_distance(torch.gather(few, 1, index[..., None].expand(-1, -1, 3)), keypoints).mean()
