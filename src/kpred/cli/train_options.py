"""Options that all training commands share, and what they say of a run that is stopped."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

from tyro.conf import arg

from kpred.cli.command import Command
from kpred.cli.devices import limit_threads
from kpred.cli.stopping import resumable


@dataclass(frozen=True, kw_only=True)
class TrainingCommand(Command):
    """A command that trains: where it runs, and whether it goes on."""

    device: Annotated[str, arg(metavar="DEVICE")] = "auto"
    """auto (CUDA where there is one), cpu, cuda, cuda:1, ..."""
    threads: Annotated[int | None, arg(metavar="N")] = None
    """CPU threads; without it, as many as torch chooses"""
    resume: Annotated[bool, arg(help_behavior_hint="")] = True
    """Start anew in a folder that holds a stopped run, and not where it stopped"""

    def limit_threads(self) -> None:
        """Limit the CPU threads, if a number is named."""
        if self.threads is not None:
            limit_threads(self.threads)


@contextmanager
def resumable_training(folder: Path) -> Iterator[None]:
    """Add to an interruption that the run folder keeps what was trained, if it has a checkpoint."""
    message = f"{folder} keeps what was trained, and the same command goes on from it"
    with resumable(message, lambda: any(folder.glob("*.checkpoint"))):
        yield


def loss_note(losses: Mapping[str, float]) -> str:
    """Write the sum of the loss terms for a progress bar."""
    return f"loss {sum(losses.values()):.3g}"
