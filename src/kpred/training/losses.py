"""Losses of the three stages (paper Sec. 3.1 to 3.3); each stage computes a loss from the data."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Iterator
from typing import Any

import torch
from torch import Tensor

from kpred.nn import STAGES, KPRed
from kpred.nn.retrieval import DECODED_POINTS
from kpred.ops import ball_query, chamfer_distance, farthest_point_sampling
from kpred.ops.chamfer import squared_distances
from kpred.ops.regions import gather_points
from kpred.refinement.keypoints import RefineConfig, refine_keypoints
from kpred.training.augmentation import box_of, disturbed, in_full_precision, random_slices, yaw_matrices
from kpred.training.config import StageConfig, TrainConfig
from kpred.training.data import TrainingData

RANKING_POINTS = 256
"""Points per shape when all sources of a batch are compared with all its targets."""

ALIKE = 8
"""Shapes of one category that follow each other in a batch of the retrieval stage, where there are several."""

WHOLE_POINTS = 512
"""Points of the whole target that the partial stage measures from."""

TRAIN_REFINE = RefineConfig(iterations=2, points=512, prior=0.02, robust=0.0)
"""Refinement inside training losses: short, and without outliers to resist."""

Losses = dict[str, Tensor]


class Stage(ABC):
    """One stage: which parameters it learns and how a batch becomes a loss."""

    name: str

    def __init__(self, network: KPRed, data: TrainingData, config: TrainConfig) -> None:
        self.network, self.data, self.config = network, data, config
        for part in network.children():
            part.requires_grad_(False)
        for name in STAGES[self.name]:
            getattr(network, name).requires_grad_(True)

    @property
    def settings(self) -> StageConfig:
        """This stage's optimisation settings."""
        return getattr(self.config, self.name)

    def model_config(self) -> dict[str, Any]:
        """Return the network's config, which a checkpoint must match."""
        return self.network.config.to_dict()

    def parameters(self) -> Iterator[torch.nn.Parameter]:
        """Return the parameters that this stage learns."""
        for name in STAGES[self.name]:
            yield from getattr(self.network, name).parameters()

    def start(self) -> None:  # noqa: B027 - most stages have nothing to do
        """Prepare a stage that is not resumed, once before its first step."""

    @abstractmethod
    def losses(self, step: int, generator: torch.Generator) -> Losses:
        """Compute the named loss terms of one step, already weighted; their sum is minimised."""

    def draw_sources(self, target: Tensor, categories: Tensor | None, generator: torch.Generator) -> Tensor:
        """Choose rows of sources for these targets: the nearest, undeformed, of a few random ones of their category."""
        choices, batch = self.config.source_choices, len(target)
        alike = None if categories is None else categories.repeat_interleave(choices)
        rows = self.data.draw_sources(batch * choices, generator, alike)
        if choices == 1:
            return rows
        few = slice(0, RANKING_POINTS)
        distance = chamfer_distance(target[:, few].repeat_interleave(choices, 0), self.data.points[rows, few])
        return rows.view(batch, choices)[
            torch.arange(batch, device=rows.device), distance.view(batch, choices).argmin(1)
        ]

    def _equal_confidence(self) -> Tensor:
        return torch.ones(self.network.config.keypoints, device=self.data.device)

    def _few(self, clouds: Tensor) -> Tensor:
        # Points come in random order, so that the first ones are a fair sample.
        return clouds[:, : self.config.keypoint_points]

    def _targets(self, categories: Tensor | None, generator: torch.Generator) -> Tensor:
        config = self.config
        return self.data.draw_targets(self.settings.batch, config.points, config.stretch, generator, categories)


class DeformationStage(Stage):
    """L_def = L_sim + lambda_kpt L_kpt (Eq. 2): keypoints and influence, from random source/target pairs."""

    name = "deformation"

    def losses(self, step: int, generator: torch.Generator) -> Losses:
        config, data = self.config, self.data
        categories = data.draw_categories(self.settings.batch, generator)
        target = self._targets(categories, generator)
        rows = self.draw_sources(target, categories, generator)
        source = data.points[rows]
        keypoints = self.network.keypoints(self._few(torch.cat([source, target])))
        late = step >= config.late_step
        weight = config.keypoint_weight_late if late else config.keypoint_weight
        losses = {"keypoints": weight * self._spread(torch.cat([source, target]), keypoints)}
        if step < config.warmup:
            return losses
        source_keypoints, target_keypoints = keypoints.chunk(2)
        influence = self.network.influence(source, source_keypoints, data.cages[rows])
        basis = data.weights[rows].float() @ influence.transpose(1, 2)
        displacement = target_keypoints - source_keypoints
        deformed = source + basis @ displacement
        losses["similarity"] = chamfer_distance(target, deformed).mean()
        if config.refined_weight > 0:
            losses["refined"] = config.refined_weight * self._refined(source, target, basis, displacement)
        if config.consistency_weight > 0:
            again = self.network.keypoints(self._few(deformed.detach()))
            difference = (again - target_keypoints.detach()).abs().mean()
            losses["consistency"] = config.consistency_weight * difference
        return losses

    def _refined(self, source: Tensor, target: Tensor, basis: Tensor, displacement: Tensor) -> Tensor:
        """Compute CD after refinement, with the displacement held fixed: exact to first order at the optimum."""
        with torch.no_grad():
            refined = refine_keypoints(
                source, basis, displacement, target, self._equal_confidence(), TRAIN_REFINE, False
            )
        return chamfer_distance(target, source + basis @ refined).mean()

    def _spread(self, clouds: Tensor, keypoints: Tensor) -> Tensor:
        few = clouds[:, : min(512, clouds.shape[1])]
        index = farthest_point_sampling(few, self.config.spread_samples)
        spread = torch.gather(few, 1, index[..., None].expand(-1, -1, 3))
        return chamfer_distance(spread, keypoints).mean()


class FrozenDeformer(Stage):
    """A stage on top of learned keypoints and influence: the bases of all sources are computed once."""

    def __init__(self, network: KPRed, data: TrainingData, config: TrainConfig) -> None:
        super().__init__(network, data, config)
        keypoints, bases = [], []
        with torch.no_grad():
            for rows in torch.arange(len(data.points), device=data.device).split(64):
                found = network.keypoints(data.points[rows])
                influence = network.influence(data.points[rows], found, data.cages[rows])
                bases.append((data.weights[rows].float() @ influence.transpose(1, 2)).half())
                keypoints.append(found)
        self.source_keypoints, self.bases = torch.cat(keypoints), torch.cat(bases)

    def _deform(self, rows: Tensor, keypoints: Tensor) -> Tensor:
        displacement = keypoints - self.source_keypoints[rows]
        return self.data.points[rows] + self.bases[rows].float() @ displacement


class RetrievalStage(FrozenDeformer):
    """L_ret (Eq. 4): tokens must reconstruct each region as it is (Psi_1) and deformed to the target (Psi_2)."""

    name = "retrieval"

    def losses(self, step: int, generator: torch.Generator) -> Losses:
        config, network = self.config, self.network
        # Several shapes of a category: telling a bed from a lamp would teach the tokens little.
        categories = self.data.draw_categories(self.settings.batch, generator, ALIKE)
        rows = self.data.draw_sources(self.settings.batch, generator, categories)
        source, target = self.data.points[rows], self._targets(categories, generator)
        source_keypoints = self.source_keypoints[rows]
        with torch.no_grad():
            target_keypoints = network.keypoints(self._few(target))
            deformed = self._deform(rows, target_keypoints)
            index, _ = ball_query(source, source_keypoints, network.config.radius, DECODED_POINTS)
        tokens = network.retrieval_tokens(source, source_keypoints)
        losses = {"reconstruction": self._region_loss(tokens, source_keypoints, source, index)}
        if network.config.deformation_aware:
            losses["deformed"] = self._region_loss(tokens, target_keypoints, deformed, index)
            if config.ranking_weight > 0:
                target_tokens = network.retrieval_tokens(target, target_keypoints)
                ranking = self._ranking(rows, tokens, target_tokens, target, target_keypoints)
                losses["ranking"] = config.ranking_weight * ranking
        return losses

    def _region_loss(self, tokens: Tensor, keypoints: Tensor, points: Tensor, index: Tensor) -> Tensor:
        regions = gather_points(points, index).flatten(0, 1)
        rebuilt = self.network.region_decoder(tokens, keypoints).flatten(0, 1)
        # The mean over keypoints of Eq. 4; scaled so that the loss is of order one.
        return 100 * chamfer_distance(regions, rebuilt).mean()

    def _ranking(
        self, rows: Tensor, tokens: Tensor, target_tokens: Tensor, target: Tensor, keypoints: Tensor
    ) -> Tensor:
        """Compute the cross-entropy between orders of the batch's sources by true error and by token distance."""
        batch = len(rows)
        with torch.no_grad():
            few = min(RANKING_POINTS, target.shape[1])
            everyone = rows.repeat(batch)
            points, basis = self.data.points[everyone, :few], self.bases[everyone, :few].float()
            goal = target[:, :few].repeat_interleave(batch, 0)
            displacement = keypoints.repeat_interleave(batch, 0) - self.source_keypoints[everyone]
            error = chamfer_distance(goal, points + basis @ displacement)
            refined = refine_keypoints(
                points, basis, displacement, goal, self._equal_confidence(), TRAIN_REFINE, partial=False
            )
            # Both count: what users get by default, and what the paper's protocol measures.
            error = (error + chamfer_distance(goal, points + basis @ refined)).view(batch, batch)
            error = error - error.amin(1, keepdim=True)
            wanted_order = torch.softmax(-error / (0.2 * error.mean(1, keepdim=True) + 1e-9), dim=1)
        distance = (target_tokens[:, None] - tokens[None]).abs().sum(-1).mean(-1)
        return -(wanted_order * torch.log_softmax(-distance, dim=1)).sum(1).mean()


class PartialStage(FrozenDeformer):
    """L_pdef = L_usim + lambda_wkpt L_wkpt (Eq. 6, 7): the partial predictor follows the full one as its teacher."""

    name = "partial"

    def start(self) -> None:
        """Copy the teachers to the partial networks; context blocks are the identity at first."""
        network = self.network
        network.partial_keypoint_predictor.load_state_dict(network.keypoint_predictor.state_dict(), strict=False)
        network.partial_retrieval_encoder.load_state_dict(network.retrieval_encoder.state_dict())

    def losses(self, step: int, generator: torch.Generator) -> Losses:
        config, network = self.config, self.network
        categories = self.data.draw_categories(self.settings.batch, generator)
        target, seen = self.draw_partial_targets(categories, generator)
        with torch.no_grad():
            teacher = network.keypoints(self._few(target))
            confidence = network.confidence(seen, teacher)
            # Tokens and boxes cost as much as all the rest: half of the targets teach the ones, half the others.
            wanted = network.retrieval_tokens(target[::2], teacher[::2])
            if config.frame_jitter > 0:
                target, seen, teacher = self._jittered(target, seen, teacher, generator)
        keypoints = network.partial_keypoints(self._few(seen))
        # The floor keeps unseen keypoints from drifting freely.
        weight = confidence.clamp(min=config.confidence_floor)
        difference = (keypoints - teacher).abs().mean(-1)
        rows = self.data.draw_sources(self.settings.batch, generator, categories)
        deformed = self._deform(rows, keypoints)
        losses = {
            "keypoints": config.partial_keypoint_weight * (weight * difference).mean(),
            "similarity": squared_distances(seen, deformed).mean(),
        }
        if config.whole_weight > 0:
            few = target[:, :WHOLE_POINTS]
            losses["whole"] = config.whole_weight * squared_distances(few, deformed).mean()
        if config.partial_token_weight > 0:
            tokens = network.partial_retrieval_tokens(seen[::2], keypoints[::2].detach())
            off = (tokens - wanted).abs().mean(-1)
            losses["tokens"] = config.partial_token_weight * (weight[::2] * off).mean()
        if config.box_weight > 0:
            losses["box"] = config.box_weight * self._box(self._few(seen[1::2]), target[1::2])
        return losses

    @in_full_precision
    def _jittered(
        self, target: Tensor, seen: Tensor, keypoints: Tensor, generator: torch.Generator
    ) -> tuple[Tensor, Tensor, Tensor]:
        """Disturb place, size and yaw of half of the frames slightly, as in estimated frames."""
        batch = len(target)
        options: dict[str, Any] = {"generator": generator, "device": target.device}
        off = self.config.frame_jitter * torch.randint(0, 2, (batch, 1, 1), **options).float()
        factor = torch.exp(off * torch.randn(batch, 1, 1, **options))
        shift = off * torch.randn(batch, 1, 3, **options)
        rotation = yaw_matrices((off * torch.randn(batch, 1, 1, **options)).flatten())
        moved = [factor * (cloud.float() @ rotation.mT) + shift for cloud in (target, seen, keypoints)]
        return moved[0], moved[1], moved[2].clamp(-1.2, 1.2)

    def _box(self, seen: Tensor, target: Tensor) -> Tensor:
        """Compute the negative log likelihood (Laplace) of the whole object's box, in the visible part's unit box."""
        middle, half = box_of(seen)
        whole = torch.stack([target.amin(1), target.amax(1)], dim=1)
        corners, spread = self.network.whole_box((seen - middle) / half)
        return ((corners - (whole - middle) / half).abs() / spread + spread.log()).mean()

    @in_full_precision
    def draw_partial_targets(self, categories: Tensor | None, generator: torch.Generator) -> tuple[Tensor, Tensor]:
        """Draw full targets and their visible parts, by a plane (the paper) or a depth camera."""
        config, data, batch = self.config, self.data, self.settings.batch
        scanned = round(config.scanned * batch)
        cut, viewed = (None, None) if categories is None else categories.split([batch - scanned, scanned])
        target = data.draw_targets(batch - scanned, config.points, config.stretch, generator, cut)
        seen = random_slices(target, config.occlusion, generator)
        if scanned:
            whole, scans = data.draw_scanned_targets(scanned, config.points, config.stretch, generator, viewed)
            target, seen = torch.cat([target, whole]), torch.cat([seen, scans])
        return target, disturbed(seen, config.noise, config.outliers, generator)


STAGE_CLASSES: dict[str, type[Stage]] = {
    "deformation": DeformationStage,
    "retrieval": RetrievalStage,
    "partial": PartialStage,
}
