"""Training on several processes: each draws its own batches, and all take the same step with the mean gradient.

Only the first process writes files. Whatever happens to one of them (an error, Ctrl-C, a kill) ends all of them. Every
process says how it fares at the same places (`World.agree`, on the CPU); tensors on a GPU travel by NCCL.
"""

from __future__ import annotations

import dataclasses
import importlib
import signal
import threading
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from datetime import timedelta
from typing import Any, TypeVar

import torch
import torch.distributed as dist
from torch import Tensor

from kpred.errors import CheckpointError, ConfigError, KpredError

Value = TypeVar("Value")

PATIENCE = timedelta(hours=6)
"""How long the others wait for the first process, which prepares the data."""

_FINE, _STOP, _FAILED = 0, 1, 2

_STRIDE = 0x9E3779B1
"""Between the seeds of two processes: odd and large, so that no small seed of another run comes near."""


class OtherProcessFailedError(KpredError):
    """Another process of the training has failed, and says why."""


class ProcessLostError(OtherProcessFailedError):
    """Another process of the training has died."""


class StopAllProcesses(KeyboardInterrupt):
    """Raised in all processes after the same step, when one of them was interrupted."""


@dataclass
class World:
    """The processes of one training; with one process, all methods do nothing.

    Attributes:
        rank: number of this process; 0 is the one that writes.
        size: number of processes.
    """

    rank: int = 0
    size: int = 1
    _stop_requested: bool = False

    @property
    def is_first(self) -> bool:
        """Whether this process writes files."""
        return self.rank == 0

    @property
    def is_single(self) -> bool:
        """Whether there are no others."""
        return self.size == 1

    def seed(self, base: int) -> int:
        """Return the seed of this process's random stream; the first one's is `base`."""
        return base if self.is_first else (base + self.rank * _STRIDE) % 2**63

    def agree(self) -> None:
        """Wait for all processes.

        Raises:
            StopAllProcesses: one was interrupted (`interruptible`).
            OtherProcessFailedError: one has failed. LostError: one has died.
        """
        if self.is_single:
            return
        found = self._exchange(_STOP if self._stop_requested else _FINE)
        if max(found) == _FAILED:
            raise OtherProcessFailedError("Another process of this training failed.")
        if max(found) == _STOP:
            raise StopAllProcesses

    def from_first(self, make: Callable[[], Value]) -> Value:
        """Send the result of `make` in the first process to all; it may hold tensors on the CPU."""
        if self.is_single:
            return make()
        made = [make() if self.is_first else None]
        self.agree()
        with _translate_errors():
            dist.broadcast_object_list(made, src=0, device=torch.device("cpu"))
        return made[0]  # type: ignore[return-value]

    def broadcast(self, make: Callable[[], Value], device: torch.device | str) -> Value:
        """Send a dataclass of tensors from the first process to all, bit for bit, to their own `device`."""
        if self.is_single:
            return make()
        made: Any = make() if self.is_first else None

        def outline() -> tuple[type, dict[str, Any]]:
            fields = {field.name: getattr(made, field.name) for field in dataclasses.fields(made)}
            return type(made), {k: _Empty(v.shape, v.dtype) if isinstance(v, Tensor) else v for k, v in fields.items()}

        kind, values = self.from_first(outline)
        for name, value in values.items():
            if isinstance(value, _Empty):
                mine = getattr(made, name).contiguous() if made is not None else value.on(device)
                if mine.numel():
                    with _translate_errors():
                        dist.broadcast(mine.view(-1).view(torch.uint8), src=0)
                values[name] = mine
        return made if made is not None else kind(**values)

    def align(self, parameters: Iterable[Tensor]) -> None:
        """Give all processes the first one's parameters."""
        for parameter in parameters if not self.is_single else ():
            with _translate_errors():
                dist.broadcast(parameter.data, src=0)

    def average_gradients(self, parameters: Iterable[Tensor]) -> None:
        """Replace each gradient by its mean over the processes; a parameter that one does not use counts as 0 there.

        One wild gradient makes the mean of all wild, so that all skip the same steps.
        """
        if self.is_single:
            return
        learned = [parameter for parameter in parameters if parameter.requires_grad]
        # Whether a gradient is there at all matters: the optimiser leaves a parameter without one as it is.
        there = torch.tensor([float(p.grad is not None) for p in learned], device=learned[0].device)
        parts = [(p.grad if p.grad is not None else torch.zeros_like(p)).flatten().float() for p in learned]
        flat = torch.cat([there, *parts])
        with _translate_errors():
            dist.all_reduce(flat)
        used = flat[: len(learned)].tolist()
        mean = (flat[len(learned) :] / self.size).split([p.numel() for p in learned])
        for parameter, number, value in zip(learned, used, mean, strict=True):
            parameter.grad = value.view_as(parameter).to(parameter.dtype) if number else None

    def states(self, state: Tensor) -> Tensor:
        """Gather the random states of all processes, (size, bytes); one process keeps its own, (bytes,)."""
        if self.is_single:
            return state
        found = [torch.empty_like(state) for _ in range(self.size)]
        with _translate_errors():
            dist.all_gather(found, state)
        return torch.stack(found)

    def own_state(self, states: Tensor) -> Tensor:
        """Return this process's state, of those that `states` returned."""
        # A copy: torch crashes on a state that lies within another tensor.
        return states if states.dim() == 1 else states[self.rank].clone()

    def check_states(self, states: Tensor, name: object) -> None:
        """Refuse a checkpoint of another number of processes.

        Raises:
            CheckpointError: its random streams are not those of this many processes.
        """
        size = 1 if states.dim() == 1 else len(states)
        if size != self.size:
            raise CheckpointError(
                f"{name} was written by {size} processes, and this training has {self.size}; go on with "
                f"`torchrun --nproc-per-node {size} -m kpred train ...` or give another run folder."
            )

    @contextmanager
    def interruptible(self) -> Iterator[None]:
        """Stop all processes at the next `agree` after Ctrl-C, so that they end at the same step."""
        if self.is_single or threading.current_thread() is not threading.main_thread():
            yield
            return

        def request_stop(_number: int, _frame: object) -> None:
            self._stop_requested = True

        before = signal.signal(signal.SIGINT, request_stop)
        try:
            yield
        finally:
            signal.signal(signal.SIGINT, before)

    def _exchange(self, status: int) -> list[int]:
        found = [torch.zeros(1, dtype=torch.int64) for _ in range(self.size)]
        with _translate_errors():
            dist.all_gather(found, torch.tensor([status]))
        return [int(value) for value in found]


SINGLE = World()
"""One process."""


@contextmanager
def join_processes(rank: int, size: int, device: torch.device | str, start: str = "env://") -> Iterator[World]:
    """Meet the other processes at `start` (torch's `init_method`), train inside, and end together.

    If some fail, the first of these raises its own error, and all others raise `OtherProcessFailedError`.

    Raises:
        ConfigError: they cannot meet.
    """
    if size == 1:
        yield SINGLE
        return
    backend = "cpu:gloo,cuda:nccl" if torch.device(device).type == "cuda" else "gloo"
    # Its functions have the group of the time of their import as a default. Imported later (optimisers do), they would
    # keep the group and its threads alive beyond the interpreter, whose end then sometimes aborts the process.
    importlib.import_module("torch.distributed.nn.functional")
    try:
        dist.init_process_group(backend, init_method=start, rank=rank, world_size=size, timeout=PATIENCE)
    except (RuntimeError, ValueError) as error:
        reason = str(error).splitlines()[0]
        raise ConfigError(f"The {size} processes cannot meet ({reason}); start them with torchrun.") from error
    world = World(rank, size)
    try:
        try:
            yield world
        except OtherProcessFailedError:
            raise
        except BaseException as error:
            _leave(world, None if isinstance(error, StopAllProcesses) else error)
            raise
        _leave(world, None)
    finally:
        dist.destroy_process_group()


def _leave(world: World, error: BaseException | None) -> None:
    """Exchange the final status with the others' next `agree`."""
    try:
        found = world._exchange(_FINE if error is None else _FAILED)
    except ProcessLostError:
        if error is None:
            raise
        return
    if _FAILED in found and found.index(_FAILED) != world.rank:
        raise OtherProcessFailedError("Another process of this training failed.") from error


@dataclass(frozen=True)
class _Empty:
    """Stands for a tensor that is on its way."""

    shape: torch.Size
    dtype: torch.dtype

    def on(self, device: torch.device | str) -> Tensor:
        return torch.empty(self.shape, dtype=self.dtype, device=device)


@contextmanager
def _translate_errors() -> Iterator[None]:
    """Convert a broken connection to an error that says how to continue."""
    try:
        yield
    except RuntimeError as error:
        raise ProcessLostError(
            "Another process of this training died (out of memory?); the same command goes on from the last checkpoint."
        ) from error
