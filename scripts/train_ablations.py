"""Train the paper's ablation rows of several categories at once, in a given time, with torch, numpy and safetensors.

    python scripts/train_ablations.py train sa_partnet/*.npz -o trained --seconds 420
    python scripts/train_ablations.py unpack trained/*.safetensors --packs sa_partnet/*.npz --runs runs/ablation
    kpred evaluate table ablation sa_partnet/*.npz --runs runs/ablation --as-trained --finished -o ablation.json

One process a row and category, all on one device. All rows of all categories make the same number of steps: at the
beginning of a stage all its processes time their steps together, and the slowest decides. `--steps` fixes them instead.
The second command needs no GPU: it puts what was trained into run folders, as `kpred evaluate table ablation` makes.
"""

from __future__ import annotations

import argparse
import hashlib
import os
import tempfile
import time
import traceback
from dataclasses import replace
from pathlib import Path
from typing import Any

import torch
import torch.multiprocessing as processes
from ablation_steps import Job, seconds_a_step, with_steps
from ablation_weights import TrainedRuns, adopt, load_parts, parts_of, read_runs, steps_of, write_runs

from kpred.nn import STAGES, KPRed
from kpred.nn.config import preset
from kpred.shapes.pack import MeshPack
from kpred.training.ablations import FULL_ROWS, ROWS, Ablation, AblationRuns, deformation_run
from kpred.training.config import PAPER, TrainConfig
from kpred.training.data import TrainingData, prepare
from kpred.training.loop import optimise
from kpred.training.losses import STAGE_CLASSES
from kpred.training.run import new_network

GRACE = 15.0
"""Seconds over the end after which what still runs is stopped."""

WORK = {
    "deformation": {"a": "deformation-without-gsa", "f": "deformation-with-gsa"},
    "retrieval": {row.name: row.name for row in FULL_ROWS},
    "partial": {"f": "with-cb", "e": "without-cb"},
}
"""Stage -> process (named after a row of the table) -> run that it trains."""


def main() -> None:
    """Parse the arguments and work."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    commands = parser.add_subparsers(dest="command", required=True)
    train = commands.add_parser("train", help="train all rows")
    train.add_argument("packs", nargs="+", type=Path)
    train.add_argument("-o", "--output", type=Path, required=True)
    train.add_argument("--seconds", type=float, required=True)
    train.add_argument("--preset", choices=["kp-red", "kp-red-plus"], default="kp-red")
    train.add_argument("--steps", nargs=3, type=int, metavar=("DEFORMATION", "RETRIEVAL", "PARTIAL"), default=None)
    train.add_argument("--batch", type=int, default=None, help="pairs a step; without it, those of the preset")
    train.add_argument("--source-split", default=None, help="deform shapes of this split only (the paper: source)")
    train.add_argument("--seed", type=int, default=0)
    unpack = commands.add_parser("unpack", help="make run folders of what was trained")
    unpack.add_argument("files", nargs="+", type=Path)
    unpack.add_argument("--packs", nargs="+", type=Path, required=True)
    unpack.add_argument("--runs", type=Path, required=True)
    arguments = parser.parse_args()
    if arguments.command == "unpack":
        unpack_runs(arguments.files, arguments.packs, arguments.runs)
    else:
        train_rows(arguments)


def train_rows(arguments: argparse.Namespace) -> None:
    """All rows of all packs, each category's into one file of the output folder."""
    began = time.monotonic()
    arguments.output.mkdir(parents=True, exist_ok=True)
    categories = tuple(MeshPack.load(pack).category for pack in arguments.packs)
    base = PAPER if arguments.preset == "kp-red" else TrainConfig()
    if arguments.batch is not None:
        base = replace(base, **{stage: replace(getattr(base, stage), batch=arguments.batch) for stage in STAGES})
    with tempfile.TemporaryDirectory() as scratch:
        job = Job(
            tuple(arguments.packs),
            categories,
            Path(scratch),
            began + arguments.seconds,
            arguments.preset,
            None if arguments.steps is None else tuple(arguments.steps),
            replace(base, seed=arguments.seed),
            arguments.source_split,
        )
        context = processes.get_context("spawn")
        places = [(number, row.name) for number in range(len(categories)) for row in FULL_ROWS]
        paces = context.Array("d", len(places) * len(STAGES))
        barrier = context.Barrier(len(places))
        workers = [
            context.Process(target=work, args=(job, index, number, row, barrier, paces))
            for index, (number, row) in enumerate(places)
        ]
        for worker in workers:
            worker.start()
        try:
            watch(job, workers, barrier)
        finally:  # what is done is worth keeping, whatever stopped the rest
            for worker in workers:
                worker.kill()
            collect(job, arguments.output, list(paces))
    print(f"{job.end - time.monotonic():.0f} s left", flush=True)


def watch(job: Job, workers: list[Any], barrier: Any) -> None:
    """Wait for all processes, at most until the end and a little more."""
    while any(worker.is_alive() for worker in workers):
        # One that was killed would be waited for until the end.
        if any(worker.exitcode for worker in workers):
            barrier.abort()
        if time.monotonic() > job.end + GRACE:
            print("out of time: what is not done is left out", flush=True)
            return
        time.sleep(0.5)


def work(job: Job, index: int, number: int, row: str, barrier: Any, paces: Any) -> None:
    """One process: the stages in which it has a run to train; it waits for the others before each.

    `paces`: seconds a step of each process in each stage, 0 where it has none.
    """
    torch.set_num_threads(1)
    torch.set_float32_matmul_precision("high")
    device = torch.device("cuda" if torch.cuda.is_available() else "cpu")
    data = None
    if row == "f":
        data = prepared(job, number, device)
    _wait(barrier, job)
    if data is None:
        data = TrainingData(**torch.load(job.scratch / f"{number}.data", map_location=device))
    count = barrier.parties
    config = job.base
    for place, stage in enumerate(STAGES):
        run, network = WORK[stage].get(row), None
        try:
            network = None if run is None else network_before(job, number, run, stage).to(device)
        except Exception:  # the others' rows are worth having without this one
            traceback.print_exc()
        _wait(barrier, job)
        try:
            if network is not None:
                paces[place * count + index] = seconds_a_step(network, data, config, stage)
        except Exception:
            traceback.print_exc()
        _wait(barrier, job)
        config = with_steps(job, config, stage, max(paces[place * count : (place + 1) * count]))
        if network is not None and run is not None:
            train_run(job, number, run, stage, network, data, config)
        del network
        if device.type == "cuda":
            torch.cuda.empty_cache()
        _wait(barrier, job)


def prepared(job: Job, number: int, device: torch.device) -> TrainingData:
    """Prepare the data of a category, for all its processes."""
    began = time.monotonic()
    pack = MeshPack.load(job.packs[number])
    network = new_network(preset(job.preset, job.categories[number]), job.base.seed).to(device)
    data = prepare([pack], network, job.base.points, job.base.seed, device, job.source_split, batch=64)
    file = job.scratch / f"{number}.data"
    torch.save(data.__dict__, file.with_suffix(".part"))
    os.replace(file.with_suffix(".part"), file)
    print(f"{pack.category}: {len(data.targets)} shapes, prepared in {time.monotonic() - began:.0f} s", flush=True)
    return data


def network_before(job: Job, number: int, run: str, stage: str) -> KPRed:
    """Make a run's network as it is before the stage, with earlier parts from the runs that share them."""
    row = ROWS.get(run) or Ablation(run, gsa=run == deformation_run(ROWS["f"]))
    network = new_network(row.changed(preset(job.preset, job.categories[number])), job.base.seed)
    earlier = {"deformation": deformation_run(row), "retrieval": "f"}
    for before in list(STAGES)[: list(STAGES).index(stage)]:
        weights = torch.load(job.scratch / f"{number}.{earlier[before]}")
        load_parts(network, weights, before)
    return network


def train_run(
    job: Job, number: int, run: str, stage: str, network: KPRed, data: TrainingData, config: TrainConfig
) -> None:
    """Train a run's stage and leave its parts in the scratch folder."""
    began, losses = time.monotonic(), {}

    def report(_stage: str, _done: int, _total: int, values: dict[str, float]) -> None:
        losses.update(values)

    try:
        # Nothing is resumed here: what the disk has to do is only in the way.
        quiet = replace(config, checkpoint_every=1_000_000)
        stream = sorted(STAGE_CLASSES).index(stage)
        work = STAGE_CLASSES[stage](network, data, quiet)
        optimise(work, None, job.scratch / f"{number}-{run}", data.device, stream, report, log=False)
        torch.save(parts_of(network, stage), job.scratch / f"{number}.{run}")
    except Exception:
        traceback.print_exc()
        return
    text = ", ".join(f"{name} {value:.4g}" for name, value in losses.items())
    steps = getattr(config, stage).steps
    seconds = time.monotonic() - began
    category = job.categories[number]
    print(f"{category} {run}: {steps} steps, {1000 * seconds / steps:.1f} ms each; {text}", flush=True)


def collect(job: Job, output: Path, paces: list[float]) -> None:
    """Each category's runs into a file; runs that did not come to their end are left out."""
    config = job.base
    order = list(STAGES)
    for stage in order:
        file = job.scratch / f"{stage}.steps"
        if job.steps is not None or file.exists():
            steps = job.steps[order.index(stage)] if job.steps is not None else int(file.read_text())
            config = replace(config, **{stage: replace(getattr(config, stage), steps=steps)})
    device = torch.cuda.get_device_name() if torch.cuda.is_available() else "cpu"
    count = len(paces) // len(order)
    slowest = {stage: max(paces[i * count : (i + 1) * count]) for i, stage in enumerate(order)}
    for number, category in enumerate(job.categories):
        runs = [run for stage in order for run in WORK[stage].values() if (job.scratch / f"{number}.{run}").exists()]
        parts = {run: torch.load(job.scratch / f"{number}.{run}") for run in runs}
        digest = hashlib.sha256(job.packs[number].read_bytes()).hexdigest()
        facts = {"device": device, "torch": torch.__version__, "seconds_a_step": slowest}
        file = output / f"{job.packs[number].resolve().parent.name}-{category}.safetensors"
        write_runs(file, TrainedRuns(preset(job.preset, category), config, digest, job.source_split, parts, facts))
        print(f"{file}: {len(runs)} of 10 runs, {file.stat().st_size / 1e6:.1f} MB, {steps_of(config)}", flush=True)


def unpack_runs(files: list[Path], packs: list[Path], folder: Path) -> None:
    """Run folders of `kpred evaluate table ablation`, of what was trained on these packs."""
    from kpred.evaluation.database_source import content_hash
    from kpred.evaluation.tables.packs import SourcePack

    sources = {content_hash(pack): SourcePack(pack, MeshPack.load(pack)) for pack in packs}
    for file in files:
        found = read_runs(file)
        if found.data not in sources:
            raise SystemExit(f"{file} was trained on a pack that is not among those given; give it with --packs.")
        source = sources[found.data]
        place = folder / source.dataset / source.pack.category
        runs = AblationRuns(
            [source.pack], found.model, found.training, place, found.data, source_split=found.source_split
        )
        taken = adopt(runs, found.parts)
        print(f"{place}: rows {', '.join(taken)}; {steps_of(found.training)}; {found.facts}")


def _wait(barrier: Any, job: Job) -> None:
    barrier.wait(max(job.end - time.monotonic(), 0) + 600)


if __name__ == "__main__":
    main()
