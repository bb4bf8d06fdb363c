"""The run of a network with a single stage: fresh weights, exact resume, and the record beside the weights."""

from __future__ import annotations

import os
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any, TypeVar

import torch
from torch import nn

from kpred.errors import ConfigError
from kpred.json_output import write_json
from kpred.training.distributed import SINGLE, World
from kpred.training.loop import StepReport, optimise, resumable
from kpred.training.room_crops import RoomCrops
from kpred.training.single_stage import SingleStage

Network = TypeVar("Network", bound=nn.Module)

RECORD = "training.json"


def fresh_network(build: Callable[[], Network], seed: int) -> Network:
    """Build a network with random weights by seed; the caller's random state is left as it was."""
    with torch.random.fork_rng(devices=[]):
        torch.manual_seed(seed)
        return build()


def take_weights(network: nn.Module, earlier: nn.Module, folder: str | os.PathLike[str], what: str) -> None:
    """Start with the weights of an earlier network of the same architecture; both have a `config`.

    Raises:
        ConfigError: the architectures differ.
    """
    if earlier.config != network.config:
        raise ConfigError(f"{folder} holds another kind of {what}; give the same categories and settings.")
    network.load_state_dict(earlier.state_dict())


def run_stage(
    stage: SingleStage[Any],
    folder: Path,
    stream: int,
    report: StepReport | None = None,
    resume: bool = True,
    world: World = SINGLE,
    log: bool = True,
) -> None:
    """Optimise a stage, from its checkpoint in `folder` on if there is one.

    Args:
        stream: which of the random streams of one seed; log: whether a TensorBoard log is written.

    Raises:
        CheckpointError: the folder holds a checkpoint of another configuration.
        OutputError: the folder cannot be written.
    """
    device = next(stage.parameters()).device
    settings = stage.config.to_dict()
    checkpoint = resumable(folder, stage.name, stage.model_config(), settings, device, world) if resume else None
    if checkpoint:
        stage.network.load_state_dict(checkpoint.weights)
    optimise(stage, checkpoint, folder, device, stream, report, log, world=world)


def write_scan_record(
    stage: SingleStage[Any],
    folder: Path,
    shapes: Mapping[str, int],
    crops: RoomCrops | None,
    start_from: str | os.PathLike[str] | None,
) -> None:
    """Write what a network of scans was trained on beside its weights, `folder/model/training.json`.

    Raises:
        OutputError: the folder cannot be written.
    """
    record = {
        "model": stage.model_config(),
        "training": stage.config.to_dict(),
        "start_from": None if start_from is None else str(start_from),
        "shapes": dict(shapes),
        "crops": {} if crops is None else crops.numbers(),
    }
    write_json(folder / "model" / RECORD, record)
