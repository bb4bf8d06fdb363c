"""The one training loop: steps, schedule, log, checkpoints, exact resume."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping
from contextlib import nullcontext
from pathlib import Path
from typing import Any, Protocol, runtime_checkable

import torch
from torch import Tensor, nn

from kpred.errors import CheckpointError
from kpred.nn import STAGES, KPRed, save_network
from kpred.training.checkpoint import Checkpoint
from kpred.training.config import StageConfig, TrainConfig
from kpred.training.data import TrainingData
from kpred.training.distributed import SINGLE, StopAllProcesses, World
from kpred.training.losses import STAGE_CLASSES
from kpred.training.run_folder import run_folder

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
    world: World = SINGLE,
) -> None:
    """Train one stage in place; afterwards `folder` holds its checkpoint and the exported weights.

    A stage that was stopped goes on from its last checkpoint, with the same result as if it had not been stopped (on
    one device and one number of threads). A finished stage is left as it is.

    Args:
        folder: run folder; `<stage>.checkpoint` and TensorBoard's event files go here, weights to `folder/model`.
        log: write TensorBoard events, where tensorboard is installed.
        world: the processes that train together; the first one writes, logs and reports its own losses.

    Raises:
        CheckpointError: if the folder holds a checkpoint of another configuration or number of processes.
        OutputError: if the folder cannot be written.
    """
    model = network.config.to_dict()
    checkpoint = resumable(folder, stage, model, config.to_dict(), data.device, world) if resume else None
    if checkpoint:
        network.load_state_dict(checkpoint.weights)
    work = STAGE_CLASSES[stage](network, data, config)
    trained = optimise(work, checkpoint, folder, data.device, sorted(STAGE_CLASSES).index(stage), report, log, world)
    # A finished stage exports again, as it may have been killed before it could; but not over what was built on it.
    later = list(STAGES)[list(STAGES).index(stage) + 1 :]
    last = trained or not any((folder / f"{name}.checkpoint").exists() for name in later)
    if last and world.is_first:
        save_network(network, folder / "model")


@runtime_checkable
class Work(Protocol):
    """What the loop needs of a stage: its network, its settings, and the losses of a step."""

    name: str
    config: Any

    @property
    def network(self) -> nn.Module:
        """What is trained."""
        ...

    @property
    def settings(self) -> StageConfig:
        """Steps, batch, rate."""
        ...

    def model_config(self) -> dict[str, Any]:
        """Return the network's config, as stored in a checkpoint."""
        ...

    def parameters(self) -> Iterator[nn.Parameter]:
        """Return the parameters that are learned."""
        ...

    def start(self) -> None:
        """Prepare a stage that is not resumed, once before its first step."""
        ...

    def losses(self, step: int, generator: torch.Generator) -> dict[str, Tensor]:
        """Compute the named loss terms of one step; their sum is minimised."""
        ...


def optimise(
    work: Work,
    checkpoint: Checkpoint | None,
    folder: Path,
    device: torch.device,
    stream: int,
    report: StepReport | None = None,
    log: bool = True,
    world: World = SINGLE,
) -> bool:
    """Minimise a stage's losses and keep its checkpoint in `folder`; whether there was a step left to do.

    Args:
        checkpoint: where to go on; its weights are the network's already.
        stream: which of the random streams of one seed.
        world: the processes that train together, each with batches of its own: a step's gradient is their mean.

    Raises:
        OutputError: if the folder cannot be written, or another training runs in it.
    """
    with run_folder(folder) if world.is_first else nullcontext():
        return _optimise(work, checkpoint, folder, device, stream, report if world.is_first else None, log, world)


def _optimise(
    work: Work,
    checkpoint: Checkpoint | None,
    folder: Path,
    device: torch.device,
    stream: int,
    report: StepReport | None,
    log: bool,
    world: World,
) -> bool:
    network, config, stage = work.network, work.config, work.name
    path = folder / f"{stage}.checkpoint"
    if checkpoint is None:
        work.start()
    world.align(work.network.parameters())
    optimizer = torch.optim.Adam(work.parameters(), lr=work.settings.learning_rate)
    generator = torch.Generator(device=device).manual_seed(world.seed(config.seed * 3 + stream))
    first = 0
    if checkpoint:
        optimizer.load_state_dict(checkpoint.optimizer)
        generator.set_state(world.own_state(checkpoint.random_state))
        first = checkpoint.step

    total = work.settings.steps
    writer = _writer(folder / "log") if log and first < total and world.is_first else None
    network.train()
    # What an interrupt may save: the random state that belongs to `done`, and whether the weights are in mid-update.
    done, state, torn = first, generator.get_state(), False
    losses_of = torch.compile(work.losses, dynamic=False) if config.compile and device.type == "cuda" else work.losses
    try:
        with world.interruptible():
            for step in range(first, total):
                for group in optimizer.param_groups:
                    group["lr"] = learning_rate(work.settings, step)
                with torch.autocast(device.type, torch.bfloat16, enabled=config.precision == "bfloat16"):
                    losses = losses_of(step, generator)
                    loss = torch.stack(list(losses.values())).sum()
                optimizer.zero_grad(set_to_none=True)
                loss.backward()
                world.agree()
                world.average_gradients(work.parameters())
                norm = torch.nn.utils.clip_grad_norm_(work.parameters(), GRADIENT_NORM)
                # One wild batch must not poison the weights.
                torn = True
                if torch.isfinite(norm):
                    optimizer.step()
                done, state, torn = step + 1, generator.get_state(), False
                _report(losses, stage, done, total, report, writer)
                if done % config.checkpoint_every == 0 or done == total:
                    _save(path, work, optimizer, state, done, world)
    except KeyboardInterrupt as error:
        # Of several processes, one that is interrupted alone cannot save, as saving needs all.
        if not torn and (world.is_single or isinstance(error, StopAllProcesses)):
            _save(path, work, optimizer, state, done, world)
        raise
    finally:
        if writer:
            writer.close()
        network.eval()
    return first < total


def _report(
    losses: Mapping[str, Tensor], stage: str, done: int, total: int, report: StepReport | None, writer: Any
) -> None:
    """Report the losses of a step, and write each tenth to the log."""
    if not report and not writer:
        return
    values = {name: float(value.detach()) for name, value in losses.items()}
    if report:
        report(stage, done, total, values)
    if writer and done % 10 == 0:
        for name, value in values.items():
            writer.add_scalar(f"{stage}/{name}", value, done)


def learning_rate(settings: StageConfig, step: int) -> float:
    """Return the rate at a step: constant, or a cosine from the base rate to 2 % of it."""
    if settings.schedule == "constant":
        return settings.learning_rate
    return settings.learning_rate * (0.02 + 0.98 * (1 + math.cos(math.pi * step / settings.steps)) / 2)


def _save(path: Path, work: Work, optimizer: torch.optim.Optimizer, state: Tensor, done: int, world: World) -> None:
    states = world.states(state)
    if not world.is_first:
        return
    Checkpoint(
        stage=work.name,
        step=done,
        model_config=work.model_config(),
        train_config=work.config.to_dict(),
        weights=work.network.state_dict(),
        optimizer=optimizer.state_dict(),
        random_state=states,
    ).save(path)


def resumable(
    folder: Path,
    stage: str,
    model_config: dict[str, Any],
    train_config: dict[str, Any],
    device: torch.device,
    world: World = SINGLE,
) -> Checkpoint | None:
    """Load the stage's checkpoint in the (first process's) run folder; None without one.

    Raises:
        CheckpointError: if it cannot be read, or belongs to a run with other settings or another number of processes.
    """
    path = folder / f"{stage}.checkpoint"
    where = device if world.is_single else torch.device("cpu")  # it travels to the others
    checkpoint = world.from_first(lambda: Checkpoint.load(path, where) if path.exists() else None)
    if checkpoint is None:
        return None
    if checkpoint.model_config != model_config or checkpoint.train_config != train_config:
        raise CheckpointError(
            f"{path} belongs to a run with other settings; give another run folder or the same settings."
        )
    world.check_states(checkpoint.random_state, path)
    return checkpoint


def _writer(folder: Path):  # type: ignore[no-untyped-def]  # tensorboard is optional
    try:
        from torch.utils.tensorboard import SummaryWriter
    except ImportError:
        return None
    return SummaryWriter(str(folder))
