"""One of several real processes that train together: `python joined_worker.py JOBS_FILE RANK SIZE`.

JOBS_FILE holds pickled dicts: name, what goes wrong and in whose process, data, configs, run folder. Each is a training
of its own; what became of it in this process is left beside it.
"""

import os
import pickle
import signal
import sys
from pathlib import Path
from typing import Any

import torch

from kpred.training.distributed import OtherProcessFailedError, World, join_processes
from kpred.training.loop import train_stage
from kpred.training.losses import DeformationStage
from kpred.training.run import new_network

TROUBLED_STEP = 3
"""Step (counted from 0) in which something goes wrong."""


def gradients_of(work: DeformationStage, seed: int) -> list[torch.Tensor | None]:
    """Of one batch, after the warm-up."""
    for parameter in work.parameters():
        parameter.grad = None
    torch.stack(list(work.losses(TROUBLED_STEP, torch.Generator().manual_seed(seed)).values())).sum().backward()
    return [parameter.grad for parameter in work.parameters()]


class Troubled(DeformationStage):
    """The stage, in which something goes wrong."""

    trouble = ""

    def losses(self, step: int, generator: torch.Generator) -> dict[str, torch.Tensor]:
        losses = super().losses(step, generator)
        if step == TROUBLED_STEP:
            if self.trouble == "error":
                raise ValueError("this batch is broken")
            if self.trouble == "kill":
                os.kill(os.getpid(), signal.SIGKILL)
            if self.trouble == "interrupt":
                os.kill(os.getpid(), signal.SIGINT)
            if self.trouble == "wild":
                return {name: value * float("inf") for name, value in losses.items()}
        return losses


def perform(job: dict[str, Any], world: World) -> dict[str, Any]:
    """Train, or show one step's gradients."""
    network = new_network(job["model"], world.rank)  # the first process's weights must win
    data = world.broadcast(lambda: job["data"], "cpu")
    if job["name"] == "step":
        network.load_state_dict(job["weights"])
        work = DeformationStage(network, data, job["train"])
        gradients_of(work, world.seed(7))
        world.average_gradients(work.parameters())
        return {"gradients": [parameter.grad for parameter in work.parameters()], "data": data}
    steps: list[int] = []
    Troubled.trouble = job["trouble"] if world.rank == job["whose"] else ""
    with_trouble = {"deformation": Troubled}
    import kpred.training.loop

    kpred.training.loop.STAGE_CLASSES = with_trouble  # type: ignore[assignment]
    train_stage(
        network, data, job["train"], "deformation", Path(job["folder"]), log=False, world=world,
        report=lambda _s, done, _t, _l: steps.append(done),
    )  # fmt: skip
    return {"weights": network.state_dict(), "steps": steps}


def thread_names() -> list[str]:
    """Of this process, as Linux knows them; none elsewhere."""
    return [name.read_text().strip() for name in Path("/proc/self/task").glob("*/comm")]


def main() -> None:
    jobs_file, rank, size = Path(sys.argv[1]), int(sys.argv[2]), int(sys.argv[3])
    torch.set_num_threads(1)
    for job in pickle.loads(jobs_file.read_bytes()):
        answer: dict[str, Any]
        try:
            with join_processes(rank, size, "cpu", f"file://{jobs_file}.{job['name']}.meeting") as world:
                answer = perform(job, world)
        except OtherProcessFailedError as error:
            answer = {"stopped": f"{type(error).__name__}: {error}"}
        except (KeyboardInterrupt, Exception) as error:
            answer = {"error": f"{type(error).__name__}: {error}"}
        answer["threads"] = thread_names()
        Path(f"{jobs_file}.{job['name']}.{rank}").write_bytes(pickle.dumps(answer))


if __name__ == "__main__":
    signal.signal(signal.SIGINT, signal.default_int_handler)  # a suite in the background ignores it
    main()
