"""Training of the visibility network: scans of known scanners, and whether they would have seen places around."""

from __future__ import annotations

import dataclasses
import math
import os
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import torch
from torch import Tensor
from torch.nn import functional

from kpred.nn.loading import load_visibility, save_visibility
from kpred.nn.visibility import VisibilityConfig, VisibilityNetwork
from kpred.ops.typing import Float, Int
from kpred.shapes.pack import MeshPack
from kpred.synthetic.rooms.pack import RoomPack
from kpred.training.augmentation import in_full_precision, random_factors, yaw_matrices
from kpred.training.data import Progress
from kpred.training.distributed import SINGLE, World
from kpred.training.loop import StepReport
from kpred.training.room_crops import RoomCrops, prepare_crops
from kpred.training.single_stage import SingleStage
from kpred.training.single_stage_run import fresh_network, run_stage, take_weights, write_scan_record
from kpred.training.visibility_config import VisibilityTraining
from kpred.training.visibility_crops import BOX, draw_crop_scans
from kpred.training.visibility_data import VisibilityData, prepare_visibility
from kpred.training.visibility_scans import KINDS, draw_kinds, draw_visible, sample_scans

YAW = math.radians(10.0)
"""Largest yaw of a scan that is about canonical."""

CANDIDATES = 4
"""Surface points that a scan is sampled from, for each point of the largest scan."""


@dataclasses.dataclass(frozen=True, eq=False)
class VisibilityBatch:
    """Scans, places around them in the same frame, visibility labels (1 or 0), and scan kinds.

    The places are three equal groups: of the own surface, of another shape's, of the box.
    """

    scans: Float[Tensor, "batch points 3"]
    places: Float[Tensor, "batch places 3"]
    labels: Float[Tensor, "batch places"]
    kind: Int[Tensor, " batch"]


class VisibilityStage(SingleStage[VisibilityTraining]):
    """Cross-entropy of the visibility of places around scans."""

    name = "visibility"

    def __init__(
        self,
        network: VisibilityNetwork,
        data: VisibilityData,
        config: VisibilityTraining,
        crops: RoomCrops | None = None,
    ) -> None:
        self.network, self.data, self.config, self.crops = network, data, config, crops

    def losses(self, step: int, generator: torch.Generator) -> dict[str, Tensor]:
        """Compute the loss (nats a place) of one random batch."""
        batch = draw_batch(self.data, self.config, generator, self.crops)
        logits = self.network(batch.scans, batch.places)
        return {"visibility": functional.binary_cross_entropy_with_logits(logits.float(), batch.labels)}


@in_full_precision
def draw_batch(
    data: VisibilityData, config: VisibilityTraining, generator: torch.Generator, crops: RoomCrops | None = None
) -> VisibilityBatch:
    """Draw scans (about unit box) of random shapes by random scanners, and labelled places around them.

    Of a batch, `config.rooms` are crops of rooms where there are any; they come last.
    """
    whole = config.optimisation.batch
    count = whole if crops is None else whole - round(config.rooms * whole)
    options: dict[str, Any] = {"generator": generator, "device": data.clouds.device}
    rows, others = data.draw(count, generator)
    factors = random_factors(count, config.stretch, generator)
    dense = data.clouds[rows].float() * factors
    # Places are no points of the scan, which would be a little nearer to it than a surface is.
    third = config.queries // 3
    own, candidates = dense[:, :third], dense[:, third : third + CANDIDATES * config.points]
    other = data.clouds[others, :third].float() * factors
    places = _draw_places(own, other, config, generator)
    kind = draw_kinds(config, count, generator)
    visible = draw_visible(dense, candidates, places, kind, config, generator)
    # Sizes of scans are spread evenly on a logarithmic scale.
    size = math.exp(float(torch.rand(1, **options)) * math.log(config.points / config.min_points)) * config.min_points
    scans = sample_scans(candidates, visible.candidates, round(size), config, generator)
    seen = visible.places
    if crops is not None and whole > count:
        cut = draw_crop_scans(crops, whole - count, scans.shape[1], config, generator)
        scans, places, seen = (torch.cat(pair) for pair in ((scans, cut.scans), (places, cut.places), (seen, cut.seen)))
        kind = torch.cat([kind, torch.full((whole - count,), KINDS.index("crop"), device=kind.device)])
    near = YAW * (2 * torch.rand(whole, **options) - 1)
    anywhere = 2 * math.pi * torch.rand(whole, **options)
    yaw = torch.where(torch.rand(whole, **options) < config.rotated, anywhere, near)
    rotation = yaw_matrices(yaw).mT
    return VisibilityBatch(scans @ rotation, places @ rotation, seen.float(), kind)


def _draw_places(own: Tensor, other: Tensor, config: VisibilityTraining, generator: torch.Generator) -> Tensor:
    """Draw places on the own surface, on another one, and in the box, a third each."""
    options: dict[str, Any] = {"generator": generator, "device": own.device}
    surfaces = torch.cat([own, other], dim=1)
    level = config.misplaced * torch.rand(*surfaces.shape[:2], 1, **options)
    level = torch.where(torch.rand(level.shape, **options) < 0.5, level, 0.0)
    surfaces = surfaces + level * torch.randn(surfaces.shape, **options)
    extent = own.abs().amax(1, keepdim=True)
    box = BOX * extent * (2 * torch.rand(len(own), config.queries - surfaces.shape[1], 3, **options) - 1)
    return torch.cat([surfaces, box], dim=1)


def train_visibility(
    packs: Sequence[MeshPack],
    config: VisibilityTraining,
    folder: Path,
    device: torch.device | str = "cpu",
    progress: Progress | None = None,
    report: StepReport | None = None,
    resume: bool = True,
    model: VisibilityConfig | None = None,
    world: World = SINGLE,
    rooms: Sequence[RoomPack] = (),
    start_from: str | os.PathLike[str] | None = None,
) -> VisibilityNetwork:
    """Train a visibility network on shapes of all packs and leave its weights in `folder/model`.

    A stopped run goes on exactly where it was. `world`: as in `kpred.training.run.train`. `rooms`: scanned rooms; crops
    of them are `config.rooms` of the scans. `start_from`: a visibility network's folder, whose weights the training
    starts with, and whose architecture is then the default.

    Raises:
        ModelError: if there is no visibility network in `start_from`.
        ConfigError: if it is of another architecture.
        PackError: if the packs hold too few shapes.
        CheckpointError: if the folder holds a checkpoint of another configuration.
        OutputError: if the folder cannot be written.
    """
    data = world.broadcast(lambda: prepare_visibility(packs, config.seed, device, progress), device)
    crops = None
    if rooms:
        crops = world.broadcast(lambda: prepare_crops(rooms, data.categories, config.seed, device, progress), device)
    earlier = None if start_from is None else load_visibility(start_from)
    architecture = model or (VisibilityConfig() if earlier is None else earlier.config)
    network = fresh_network(lambda: VisibilityNetwork(architecture), config.seed).to(device)
    if earlier is not None and start_from is not None:
        take_weights(network, earlier, start_from, "visibility network")
    stage = VisibilityStage(network, data, config, crops)
    run_stage(stage, folder, 4, report, resume, world)
    if world.is_first:
        save_visibility(network, folder / "model")
        numbers = torch.bincount(data.category, minlength=len(data.categories)).tolist()
        write_scan_record(stage, folder, dict(zip(data.categories, numbers, strict=True)), crops, start_from)
    return network
