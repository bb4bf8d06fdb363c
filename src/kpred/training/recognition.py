"""Training of the recognizer: scans that stand right, rotated ones, and other objects."""

from __future__ import annotations

import dataclasses
import math
import os
from collections.abc import Sequence
from pathlib import Path
from typing import Any, NamedTuple

import torch
from torch import Tensor
from torch.nn import functional

from kpred.nn.loading import load_recognizer, save_recognizer
from kpred.nn.recognizer import MAX_YAW_CORRECTION, Recognizer, RecognizerConfig
from kpred.ops.typing import Bool, Float, Int
from kpred.shapes.pack import MeshPack
from kpred.synthetic.rooms.pack import RoomPack
from kpred.training.augmentation import (
    box_of,
    disturbed,
    in_full_precision,
    random_factors,
    random_slices,
    random_views,
    yaw_matrices,
)
from kpred.training.data import Progress
from kpred.training.distributed import SINGLE, World
from kpred.training.loop import StepReport
from kpred.training.recognition_config import RecognitionConfig
from kpred.training.recognition_data import OTHER, RecognitionData, prepare_recognition
from kpred.training.room_crops import RoomCrops, prepare_crops, segmented
from kpred.training.single_stage import SingleStage
from kpred.training.single_stage_run import fresh_network, run_stage, take_weights, write_scan_record

RIGHT, WRONG = math.radians(15.0), math.radians(25.0)
"""A cloud that is off by less than the first stands right, by more than the second wrongly; between, none is taught."""


class RecognitionBatch(NamedTuple):
    """Clouds of one step.

    Attributes:
        clouds: (B, N, 3); labels: (B,) category, -1 for none to learn.
        yaws: (B,) missing yaw, radians; learned: (B,) whether it is learned.
    """

    clouds: Float[Tensor, "batch points 3"]
    labels: Int[Tensor, " batch"]
    yaws: Float[Tensor, " batch"]
    learned: Bool[Tensor, " batch"]


class RecognitionStage(SingleStage[RecognitionConfig]):
    """Cross-entropy of the answers, and the error of the missing turn where a cloud stands about right."""

    name = "recognition"

    def __init__(
        self,
        network: Recognizer,
        data: RecognitionData,
        config: RecognitionConfig,
        crops: RoomCrops | None = None,
    ) -> None:
        self.network, self.data, self.config, self.crops = network, data, config, crops

    def losses(self, step: int, generator: torch.Generator) -> dict[str, Tensor]:
        """Compute the loss terms of one random batch."""
        clouds, answer, yaw, teaches = self.batch(generator)
        logits, found = self.network(clouds)
        taught = answer >= 0
        losses = {"answer": functional.cross_entropy(logits[taught], answer[taught])}
        if bool(teaches.any()):
            error = (found[teaches] - yaw[teaches]) / MAX_YAW_CORRECTION
            losses["yaw"] = self.config.yaw_weight * error.abs().mean()
        return losses

    @in_full_precision
    def batch(self, generator: torch.Generator) -> RecognitionBatch:
        """Draw clouds (B, N, 3), labels (B,) (-1: none), missing yaws (B,), and the mask of yaws to learn."""
        config, data, count = self.config, self.data, self.settings.batch
        options: dict[str, Any] = {"generator": generator, "device": data.clouds.device}
        cut = 0 if self.crops is None else round(config.rooms * count)
        rows = data.draw(count - cut, config.others, generator)
        period, category = data.period[rows], data.category[rows]
        clouds = self._seen(rows, generator)
        if self.crops is not None and cut:
            chosen = self.crops.draw(cut, config.room_others, generator)
            clouds = torch.cat([clouds, segmented(self.crops, chosen, config.points, generator)])
            period, category = (
                torch.cat([period, self.crops.period[chosen]]),
                torch.cat([category, self.crops.category[chosen]]),
            )
        factors = random_factors(count, config.stretch, generator)
        # A square or round top stays so.
        square = (period < 2.0)[:, None]
        factors[:, :, 2] = torch.where(square, factors[:, :, 0].abs(), factors[:, :, 2])
        clouds = disturbed(clouds * factors, config.noise, config.outliers, generator)
        clouds = self._with_floor(clouds, generator)
        # `off` is how far the cloud is turned from facing +z; the turn that is missing is its opposite.
        jitter = MAX_YAW_CORRECTION * 0.8 * (2 * torch.rand(count, **options) - 1)
        kind = torch.rand(count, **options)
        quarters = math.pi / 2 * torch.randint(1, 4, (count,), **options).float()
        anywhere = 2 * math.pi * torch.rand(count, **options)
        is_right, is_quarter = kind < config.right, (kind >= config.right) & (kind < config.right + config.quarter)
        tilted = kind >= 1 - config.tilted
        off = torch.where(is_right, jitter, torch.where(is_quarter, quarters + jitter, anywhere))
        clouds = clouds @ yaw_matrices(off).mT
        clouds = torch.where(tilted[:, None, None], clouds @ self._tilts(count, generator).mT, clouds)
        yaw = -smallest_yaw(off, period)
        known = category < len(data.categories)
        stands = known & ~tilted
        answer = torch.where(stands & (yaw.abs() <= RIGHT), category, len(data.categories))
        unsure = stands & (yaw.abs() > RIGHT) & (yaw.abs() < WRONG)
        answer = torch.where(unsure, -1, answer)
        learned = stands & (yaw.abs() < MAX_YAW_CORRECTION * 0.9) & (period > 0)
        return RecognitionBatch(clouds, answer, yaw, learned)

    def _seen(self, rows: Tensor, generator: torch.Generator) -> Tensor:
        config, data = self.config, self.data
        options: dict[str, Any] = {"generator": generator, "device": data.clouds.device}
        kind = torch.rand(len(rows), 1, 1, **options)
        dense = data.clouds[rows].float()
        whole, scanned = dense[:, : 2 * config.points], random_views(dense, config.points, generator)
        cut = random_slices(whole, (0.2, 0.7), generator)[:, : config.points]
        return torch.where(
            kind < config.sliced,
            cut,
            torch.where(kind < config.sliced + config.whole, whole[:, : config.points], scanned),
        )

    def _with_floor(self, clouds: Tensor, generator: torch.Generator) -> Tensor:
        """Move some points of some clouds to the level of their lowest, around the object."""
        options: dict[str, Any] = {"generator": generator, "device": clouds.device}
        middle, half = box_of(clouds)
        spot = middle + half * (2 * torch.rand(clouds.shape, **options) - 1) * 1.1
        low = clouds.amin(1)[:, 1:2].expand(-1, clouds.shape[1]) + 0.01 * torch.randn(clouds.shape[:2], **options)
        spot = torch.stack([spot[..., 0], low, spot[..., 2]], dim=2)
        fraction = 0.3 * torch.rand(len(clouds), 1, 1, **options)
        fraction = torch.where(torch.rand(len(clouds), 1, 1, **options) < self.config.floor, fraction, 0.0)
        return torch.where(torch.rand(*clouds.shape[:2], 1, **options) < fraction, spot, clouds)

    def _tilts(self, count: int, generator: torch.Generator) -> Tensor:
        """Draw rotations that lay a cloud on its side, back or front, or turn it upside down."""
        options: dict[str, Any] = {"generator": generator, "device": self.data.clouds.device}
        eye = torch.eye(3, device=self.data.clouds.device)
        x, y, z = eye
        choices = torch.stack([torch.stack([x, -z, y]), torch.stack([x, z, -y]), torch.stack([x, -y, -z])])
        choices = torch.cat([choices, torch.stack([torch.stack([y, -x, z]), torch.stack([-y, x, z])])])
        around = yaw_matrices(2 * math.pi * torch.rand(count, **options))
        return around @ choices[torch.randint(0, len(choices), (count,), **options)]


def smallest_yaw(off: Tensor, period: Tensor) -> Tensor:
    """Reduce yaws (radians) modulo each shape's period, to (-period / 2, period / 2]; 0 for round shapes."""
    safe = torch.where(period > 0, period, 2 * math.pi)
    reduced = torch.remainder(off + safe / 2, safe) - safe / 2
    return torch.where(period > 0, reduced, 0.0)


def with_categories(earlier: Recognizer, fresh: Recognizer) -> Recognizer:
    """Copy a recognizer's weights for the categories of another one, which gives those of categories that are new.

    One of another architecture is returned as it is.
    """
    names = fresh.config.categories
    if dataclasses.replace(earlier.config, categories=names) != fresh.config:
        return earlier
    changed = Recognizer(fresh.config)
    weights = {key: value for key, value in earlier.state_dict().items() if not key.startswith("second.")}
    rows = [earlier.config.categories.index(name) if name in earlier.config.categories else None for name in names]
    for key in ("output.weight", "output.bias"):
        new, old = fresh.state_dict()[key], weights[key]
        weights[key] = torch.stack([*(new[i] if row is None else old[row] for i, row in enumerate(rows)), *old[-2:]])
    changed.load_state_dict(weights)
    return changed


def train_recognizer(
    packs: Sequence[MeshPack],
    config: RecognitionConfig,
    folder: Path,
    device: torch.device | str = "cpu",
    progress: Progress | None = None,
    report: StepReport | None = None,
    resume: bool = True,
    model: RecognizerConfig | None = None,
    start_from: str | os.PathLike[str] | None = None,
    world: World = SINGLE,
    rooms: Sequence[RoomPack] = (),
) -> Recognizer:
    """Train one recognizer for the categories of all packs and leave its weights in `folder/model`.

    Packs of the category `other` show what is none of them. A stopped run goes on exactly where it was. `start_from`
    is a recognizer's folder, whose weights the training starts with, and whose architecture is then the default; what
    it answers of categories that the packs do not hold is left out, and new categories start at random.
    `world`: as in `kpred.training.run.train`. `rooms`: scanned rooms; crops of them are `config.rooms` of the clouds.

    Raises:
        ModelError: if there is no recognizer in `start_from`.
        ConfigError: if it is of another architecture.
        PackError: if the packs hold too few shapes.
        CheckpointError: if the folder holds a checkpoint of another configuration.
        OutputError: if the folder cannot be written.
    """
    data = world.broadcast(lambda: prepare_recognition(packs, config.seed, device, progress), device)
    crops = None
    if rooms:
        crops = world.broadcast(lambda: prepare_crops(rooms, data.categories, config.seed, device, progress), device)
    earlier = None if start_from is None else load_recognizer(start_from)
    usual = RecognizerConfig() if earlier is None else earlier.config
    architecture = dataclasses.replace(model or usual, categories=data.categories)
    network = fresh_network(lambda: Recognizer(architecture), config.seed).to(device)
    if earlier is not None and start_from is not None:
        take_weights(network, with_categories(earlier, network), start_from, "recognizer")
    stage = RecognitionStage(network, data, config, crops)
    run_stage(stage, folder, 3, report, resume, world)
    if world.is_first:
        save_recognizer(network, folder / "model")
        numbers = torch.bincount(data.category, minlength=len(data.categories) + 1).tolist()
        write_scan_record(stage, folder, dict(zip((*data.categories, OTHER), numbers, strict=True)), crops, start_from)
    return network
