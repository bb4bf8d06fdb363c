"""`torchrun --nproc-per-node N -m kpred train ...`: this process's place among those that train together."""

from __future__ import annotations

import os
from collections.abc import Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING

from kpred.cli.devices import found_device
from kpred.errors import ConfigError

if TYPE_CHECKING:
    from kpred.training.distributed import World


def count() -> int:
    """Return the number of processes that torchrun has started; 1 without it."""
    return int(os.environ.get("WORLD_SIZE", "1"))


def own_device(name: str) -> str:
    """Return the device of this name; each of several processes on a machine takes its own GPU.

    Raises:
        ConfigError: it is not there, or there are fewer GPUs than processes.
    """
    import torch

    device = found_device(name)
    if count() == 1 or not device.startswith("cuda"):
        return device
    here, rank = int(os.environ.get("LOCAL_WORLD_SIZE", "1")), int(os.environ.get("LOCAL_RANK", "0"))
    if device != "cuda":
        raise ConfigError(f"Several processes cannot share {device}; use --device cuda, which gives each one its own.")
    if here > torch.cuda.device_count():
        raise ConfigError(
            f"This machine has {torch.cuda.device_count()} GPUs for {here} processes; "
            "start as many processes as there are GPUs, or use --device cpu."
        )
    torch.cuda.set_device(rank)
    return f"cuda:{rank}"


@contextmanager
def joined_world(device: str) -> Iterator[World]:
    """Join the processes that torchrun has started; only one reports failures and stops."""
    from kpred.training.distributed import OtherProcessFailedError, ProcessLostError, join_processes

    rank = int(os.environ.get("RANK", "0"))
    try:
        with join_processes(rank, count(), device) as world:
            yield world
    except ProcessLostError as error:
        if rank == 0:
            raise
        raise SystemExit(1) from error
    except OtherProcessFailedError as error:
        raise SystemExit(1) from error
    except KeyboardInterrupt as error:
        if rank == 0:
            raise
        raise SystemExit(130) from error


def refuse(what: str) -> None:
    """Refuse torchrun where processes would overwrite each other's files.

    Raises:
        ConfigError: there are several processes.
    """
    if count() > 1:
        raise ConfigError(f"{what} runs in one process; start it without torchrun.")
