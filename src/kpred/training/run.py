"""A category's whole training: data once, then the stages in their order, into one run folder."""

from __future__ import annotations

import os
from collections.abc import Sequence
from contextlib import nullcontext
from pathlib import Path
from typing import Any

import torch

from kpred.errors import CheckpointError, ConfigError
from kpred.json_output import write_json
from kpred.nn import STAGES, KPRed, ModelConfig, load_model
from kpred.shapes.pack import MeshPack
from kpred.training.checkpoint import Checkpoint
from kpred.training.config import TrainConfig
from kpred.training.data import Progress, prepare
from kpred.training.distributed import SINGLE, World
from kpred.training.loop import StepReport, train_stage
from kpred.training.run_folder import run_folder


def new_network(config: ModelConfig, seed: int) -> KPRed:
    """Return initialise fresh networks, preserving the caller's random state."""
    with torch.random.fork_rng(devices=[]):
        torch.manual_seed(seed)
        return KPRed(config)


def train(
    packs: Sequence[MeshPack],
    model_config: ModelConfig,
    config: TrainConfig,
    folder: Path,
    stages: Sequence[str] = tuple(STAGES),
    device: torch.device | str = "cpu",
    source_split: str | None = None,
    progress: Progress | None = None,
    report: StepReport | None = None,
    resume: bool = True,
    start_from: str | os.PathLike[str] | None = None,
    world: World = SINGLE,
) -> KPRed:
    """Train the given stages of one category and leave weights in `folder/model`.

    Stages build on each other: one that is not in `stages` is taken from the run folder's checkpoints, or, with
    `start_from`, from finished weights of the category (the name or folder of a model; parts that are new in this
    architecture start fresh). A stopped run goes on where it was. Of several processes (`world`, made by
    `kpred.training.distributed.join_processes`) the first prepares the data for all and writes the files; each draws
    its own batches, so that a step sees as many times the batch as there are processes.

    Raises:
        ConfigError: if a stage does not exist, or one between two others is left out.
        CheckpointError: if an earlier stage was never trained in this folder, or its checkpoint does not fit.
        PackError: if the packs hold too few shapes.
        OutputError: if the folder cannot be made or written, or another training runs in it.
    """
    unknown = set(stages) - set(STAGES)
    if unknown:
        raise ConfigError(f"There is no training stage {sorted(unknown)}; choose from {', '.join(STAGES)}.")
    wanted = [stage for stage in STAGES if stage in stages]
    if not wanted or ",".join(wanted) not in ",".join(STAGES):
        raise ConfigError(f"Stages {list(stages)} leave one out; name stages that follow each other.")
    network = new_network(model_config, config.seed).to(device)
    order = list(STAGES)
    first = min(order.index(stage) for stage in stages)
    if start_from is not None:
        _take_over(network, start_from)
    elif first > 0:
        earlier = folder / f"{order[first - 1]}.checkpoint"
        where = device if world.is_single else "cpu"
        checkpoint = world.from_first(lambda: _built_on(earlier, order[first - 1], where))
        if checkpoint.model_config != model_config.to_dict():
            raise CheckpointError(
                f"{earlier} holds another architecture; give another run folder or the same model settings."
            )
        network.load_state_dict(checkpoint.weights)
    network.to(device)
    with run_folder(folder) if world.is_first else nullcontext():
        data = world.broadcast(
            lambda: prepare(list(packs), network, config.points, config.seed, device, source_split, progress), device
        )
        for stage in order:
            if stage in stages:
                train_stage(network, data, config, stage, folder, report=report, resume=resume, world=world)
        shapes = {"packs": [len(pack) for pack in packs], "sources": len(data.sources), "targets": len(data.targets)}
        if data.categories is not None:
            shapes["categories"] = sorted({pack.category for pack in packs})
        if world.is_first:
            _record(folder, model_config, config, wanted, start_from, shapes, world.size)
    return network


def _built_on(path: Path, stage: str, device: torch.device | str) -> Checkpoint:
    if not path.exists():
        raise CheckpointError(f"{path} is missing; train the stage '{stage}' in this folder first.")
    return Checkpoint.load(path, device)


def _take_over(network: KPRed, name: str | os.PathLike[str]) -> None:
    """Load weights of another model of the same category, part by part; parts of another shape start fresh.

    A model of one network alone is taken whatever its category: its keypoints are where another category begins.

    Raises:
        ModelError: if there is no such model, or it does not know the category.
        ConfigError: if keypoints, influence or tokens are of another architecture.
    """
    model = load_model(name)
    only = len(model) == 1
    found = model[next(iter(model)) if only else network.config.category].state_dict()
    for part, module in network.named_children():
        weights = {key.removeprefix(f"{part}."): value for key, value in found.items() if key.startswith(f"{part}.")}
        own = module.state_dict()
        if set(weights) == set(own) and all(weights[key].shape == own[key].shape for key in own):
            module.load_state_dict(weights)
        elif part not in STAGES["partial"]:
            raise ConfigError(f"{name}: its {part} is of another architecture; give the model settings that it has.")


def _record(
    folder: Path,
    model_config: ModelConfig,
    config: TrainConfig,
    stages: Sequence[str],
    start_from: str | os.PathLike[str] | None,
    shapes: dict[str, Any],
    processes: int,
) -> None:
    """Write the training record beside the weights: the content of the model card."""
    values: dict[str, Any] = {
        "model": model_config.to_dict(),
        "stages": list(stages),
        "start_from": None if start_from is None else str(start_from),
        "training": config.to_dict(),
        "shapes": shapes,
    }
    if processes > 1:
        values["processes"] = processes  # each with batches of its own
    write_json(folder / "model" / "training.json", values)
