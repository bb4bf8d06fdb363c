"""The one training loop: steps, schedule, log, checkpoints, exact resume."""

from __future__ import annotations

import math
from collections.abc import Callable
from pathlib import Path

import torch
from torch import Tensor

from kpred.errors import CheckpointError
from kpred.nn import STAGES, KPRed, save_network
from kpred.training.checkpoint import Checkpoint
from kpred.training.config import StageConfig, TrainConfig
from kpred.training.data import TrainingData
from kpred.training.stages import STAGE_CLASSES, Stage

GRADIENT_NORM = 1.0
"""Gradients are clipped to this norm: the first steps after the warm-up would explode otherwise."""

StepReport = Callable[[str, int, int, dict[str, float]], None]
"""Called after every step with (stage, steps done, steps in all, losses)."""


def train_stage(
    network: KPRed,
    data: TrainingData,
    config: TrainConfig,
    stage: str,
    folder: Path,
    report: StepReport | None = None,
    log: bool = True,
    resume: bool = True,
) -> None:
    """Train one stage in place; afterwards `folder` holds its checkpoint and the exported weights.

    A stage that was stopped goes on from its last checkpoint, with the same result as if it had not been stopped (on
    one device and one number of threads). A finished stage is left as it is.

    Args:
        folder: run folder; `<stage>.checkpoint` and TensorBoard's event files go here, weights to `folder/model`.
        log: write TensorBoard events, where tensorboard is installed.

    Raises:
        CheckpointError: if the folder holds a checkpoint of another configuration.
        OutputError: if the folder cannot be written.
    """
    path = folder / f"{stage}.checkpoint"
    checkpoint = _fitting_checkpoint(path, network, config, stage, data.device) if resume and path.exists() else None
    if checkpoint:
        network.load_state_dict(checkpoint.weights)
    work = STAGE_CLASSES[stage](network, data, config)
    if not checkpoint:
        work.start()
    optimizer = torch.optim.Adam(work.parameters(), lr=work.settings.learning_rate)
    generator = torch.Generator(device=data.device).manual_seed(config.seed * 3 + sorted(STAGE_CLASSES).index(stage))
    first = 0
    if checkpoint:
        optimizer.load_state_dict(checkpoint.optimizer)
        generator.set_state(checkpoint.random_state)
        first = checkpoint.step

    total = work.settings.steps
    writer = _writer(folder / "log") if log and first < total else None
    network.train()
    # What an interrupt may save: the random state that belongs to `done`, and whether the weights are in mid-update.
    done, state, torn = first, generator.get_state(), False
    losses_of = (
        torch.compile(work.losses, dynamic=False) if config.compile and data.device.type == "cuda" else work.losses
    )
    try:
        for step in range(first, total):
            for group in optimizer.param_groups:
                group["lr"] = learning_rate(work.settings, step)
            with torch.autocast(data.device.type, torch.bfloat16, enabled=config.precision == "bfloat16"):
                losses = losses_of(step, generator)
                loss = torch.stack(list(losses.values())).sum()
            optimizer.zero_grad(set_to_none=True)
            loss.backward()
            norm = torch.nn.utils.clip_grad_norm_(work.parameters(), GRADIENT_NORM)
            # One wild batch must not poison the weights.
            torn = True
            if torch.isfinite(norm):
                optimizer.step()
            done, state, torn = step + 1, generator.get_state(), False
            if report or writer:
                values = {name: float(value.detach()) for name, value in losses.items()}
                if report:
                    report(stage, done, total, values)
                if writer and done % 10 == 0:
                    for name, value in values.items():
                        writer.add_scalar(f"{stage}/{name}", value, done)
            if done % config.checkpoint_every == 0 or done == total:
                _save(path, work, optimizer, state, done)
    except KeyboardInterrupt:
        if not torn:
            _save(path, work, optimizer, state, done)
        raise
    finally:
        if writer:
            writer.close()
        network.eval()
    # A finished stage exports again, as it may have been killed before it could; but not over what was built on it.
    later = list(STAGES)[list(STAGES).index(stage) + 1 :]
    if first < total or not any((folder / f"{name}.checkpoint").exists() for name in later):
        save_network(network, folder / "model")


def learning_rate(settings: StageConfig, step: int) -> float:
    """Rate at a step: constant, or a cosine from the base rate to 2 % of it."""
    if settings.schedule == "constant":
        return settings.learning_rate
    return settings.learning_rate * (0.02 + 0.98 * (1 + math.cos(math.pi * step / settings.steps)) / 2)


def _save(path: Path, work: Stage, optimizer: torch.optim.Optimizer, state: Tensor, done: int) -> None:
    Checkpoint(
        stage=work.name,
        step=done,
        model_config=work.network.config.to_dict(),
        train_config=work.config.to_dict(),
        weights=work.network.state_dict(),
        optimizer=optimizer.state_dict(),
        random_state=state,
    ).save(path)


def _fitting_checkpoint(
    path: Path, network: KPRed, config: TrainConfig, stage: str, device: torch.device
) -> Checkpoint:
    checkpoint = Checkpoint.load(path, device)
    same_model = checkpoint.model_config == network.config.to_dict()
    if not same_model or checkpoint.train_config != config.to_dict():
        raise CheckpointError(
            f"{path} belongs to a run with other settings; give another run folder or the same settings."
        )
    return checkpoint


def _writer(folder: Path):  # type: ignore[no-untyped-def]  # tensorboard is optional
    try:
        from torch.utils.tensorboard import SummaryWriter
    except ImportError:
        return None
    return SummaryWriter(str(folder))
