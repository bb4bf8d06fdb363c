"""How many steps each stage of `train_ablations.py` makes: the slowest process decides for all."""

from __future__ import annotations

import copy
import os
import tempfile
import time
from dataclasses import dataclass, replace
from pathlib import Path

from kpred.nn import STAGES, KPRed
from kpred.training.config import TrainConfig
from kpred.training.data import TrainingData
from kpred.training.loop import optimise
from kpred.training.losses import STAGE_CLASSES

FRACTIONS = {"deformation": 0.34, "retrieval": 0.32, "partial": 0.34}
"""Of the time that is left after the data are prepared; all rows have the second stage, so that its steps are slow."""

PROBE, SETTLE = 30, 6
SAFETY = 0.88
SETTING_UP = 4.0
"""Seconds before the steps of each stage: bases of all sources, and the timing."""


@dataclass(frozen=True)
class Job:
    """What all processes share: arguments, places, and the clock's end."""

    packs: tuple[Path, ...]
    categories: tuple[str, ...]
    scratch: Path
    end: float
    preset: str
    steps: tuple[int, ...] | None
    base: TrainConfig
    source_split: str | None


def seconds_a_step(network: KPRed, data: TrainingData, config: TrainConfig, stage: str) -> float:
    """Mean time of a step beside all else that runs, without the first ones."""
    began = 0.0

    def report(_stage: str, done: int, _total: int, _losses: dict[str, float]) -> None:
        nonlocal began
        if done == SETTLE:
            began = time.monotonic()

    probe = replace(
        config, warmup=0, checkpoint_every=PROBE + 1, **{stage: replace(getattr(config, stage), steps=PROBE)}
    )
    with tempfile.TemporaryDirectory() as scratch:
        work = STAGE_CLASSES[stage](copy.deepcopy(network), data, probe)
        optimise(work, None, Path(scratch), data.device, 0, report, log=False)
    return (time.monotonic() - began) / (PROBE - SETTLE)


def with_steps(job: Job, config: TrainConfig, stage: str, a_step: float) -> TrainConfig:
    """Set the steps that fit into the stage's fraction of the time that is left; the same for all."""
    order = list(STAGES)
    steps_file = job.scratch / f"{stage}.steps"
    if job.steps is not None:
        steps = job.steps[order.index(stage)]
    else:
        # The first process to come here decides, and all others read what it decided.
        later = order[order.index(stage) :]
        left = (
            (job.end - time.monotonic() - SETTING_UP * len(later))
            * FRACTIONS[stage]
            / sum(FRACTIONS[name] for name in later)
        )
        mine = max(PROBE, int((left - PROBE * a_step) / max(a_step, 1e-6) * SAFETY))
        try:
            with open(steps_file.with_suffix(f".{os.getpid()}"), "w") as file:
                file.write(str(mine))
            os.link(file.name, steps_file)
            print(f"{stage}: {1000 * a_step:.1f} ms a step of the slowest, {mine} steps", flush=True)
        except FileExistsError:
            pass
        steps = int(steps_file.read_text())
    return replace(config, **{stage: replace(getattr(config, stage), steps=steps)})
