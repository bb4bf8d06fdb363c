"""Training of Neural Cages: random pairs of shapes, similarity, and what keeps cages and shapes sound."""

from __future__ import annotations

import torch
from torch import Tensor

from kpred.ops import chamfer_distance
from kpred.ops.nearest import squared_distance_matrix
from kpred.ops.typing import Float
from kpred.peers.networks.neural_cages import NeuralCages
from kpred.peers.training.config import NeuralCagesTraining
from kpred.training.data import TrainingData
from kpred.training.single_stage import SingleStage

NEIGHBOURS = 8
"""Points around each point among which its two neighbours are chosen that span its normal."""

FLAT = 1e-6
"""Least area (twice, unit box squared) of the triangle of a point and its neighbours for a normal."""


class NeuralCagesStage(SingleStage[NeuralCagesTraining]):
    """L = L_align + L_MVC + L_shape of the publication; L_shape of man-made things: normals and symmetry."""

    name = "neural-cages"

    def __init__(self, network: NeuralCages, data: TrainingData, config: NeuralCagesTraining) -> None:
        self.network, self.data, self.config = network, data, config

    def losses(self, step: int, generator: torch.Generator) -> dict[str, Tensor]:
        """Compute the loss terms of one batch of pairs, a quarter of them of a source with itself."""
        config, data, network, batch = self.config, self.data, self.network, self.settings.batch
        target = data.draw_targets(batch, config.points, config.stretch, generator)
        source = data.points[data.draw_sources(batch, generator), : config.points]
        codes, wanted = network.encode(torch.cat([source, target])).chunk(2)
        cage = network.cage(codes)
        weights = network.coordinates(source, cage)
        moved = source + weights @ network.motion(codes, wanted, cage)
        own = slice(0, max(1, batch // 4))
        stray = weights[own] @ network.motion(codes[own], codes[own], cage[own])
        mirrored = moved * moved.new_tensor([-1.0, 1.0, 1.0])
        return {
            "similarity": chamfer_distance(target, moved).mean(),
            "identity": stray.square().sum(-1).mean(),
            "coordinates": config.coordinate_weight * weights.clamp(max=0).square().mean(),
            "normals": config.shape_weight * normal_change(source, moved),
            "symmetry": config.shape_weight * chamfer_distance(moved, mirrored).mean(),
        }


def normal_change(before: Float[Tensor, "batch points 3"], after: Float[Tensor, "batch points 3"]) -> Float[Tensor, ""]:
    """Compute the mean of 1 - cosine between the points' normals before and after."""
    with torch.no_grad():
        few = min(NEIGHBOURS + 1, before.shape[1])
        near = squared_distance_matrix(before, before).topk(few, largest=False).indices[..., 1:]
        spokes = _gathered(before, near) - before[:, :, None]
        area = torch.linalg.cross(spokes[:, :, :1].expand_as(spokes), spokes).norm(dim=-1)
        best = area.amax(-1) > FLAT
        pair = torch.stack([near[..., 0], near.gather(2, area.argmax(-1, keepdim=True)).squeeze(2)], dim=-1)
    cosine = torch.nn.functional.cosine_similarity(_normals(before, pair), _normals(after, pair), dim=-1, eps=FLAT)
    return torch.where(best, 1 - cosine, 0.0).mean()


def _normals(points: Tensor, pair: Tensor) -> Tensor:
    first, second = (_gathered(points, pair) - points[:, :, None]).unbind(2)
    return torch.linalg.cross(first, second)


def _gathered(points: Tensor, index: Tensor) -> Tensor:
    """Gather rows (batch, points, k, 3) of the points."""
    flat = torch.gather(points, 1, index.flatten(1)[..., None].expand(-1, -1, 3))
    return flat.unflatten(1, index.shape[1:])
