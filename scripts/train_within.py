"""Train one network of the bundled model in a given time, on a machine with nothing but torch, numpy and safetensors.

    python scripts/train_within.py recognizer PACKS/*.npz -o RUN --seconds 400
    python scripts/train_within.py kp-red-plus PACKS/chair*.npz -o RUN --seconds 400
    python scripts/train_within.py kp-red PACKS/chair*.npz -o RUN --seconds 400
    python scripts/train_within.py recognizer PACKS/*.npz -o RUN --seconds 300 --start-from bundled
    python scripts/train_within.py kp-red-plus PACKS/chair*.npz -o RUN --seconds 400 --start-from bundled

Every stage's steps are timed first, as fast as they are beside all else that runs, so that the schedule comes to its
end in time. How many steps came of it stands in RUN/model/training.json; with it, `kpred train` does the same.
"""

from __future__ import annotations

import argparse
import copy
import dataclasses
import json
import tempfile
import time
from functools import partial
from pathlib import Path
from typing import Any

import torch

from kpred.nn import (
    KPRed,
    Recognizer,
    RecognizerConfig,
    load_model,
    load_recognizer,
    save_network,
    save_recognizer,
)
from kpred.nn.config import preset
from kpred.nn.loading import BUNDLED
from kpred.shapes.pack import MeshPack
from kpred.training.config import PAPER, StageConfig, TrainConfig
from kpred.training.data import prepare
from kpred.training.loop import optimise, train_stage
from kpred.training.losses import STAGE_CLASSES
from kpred.training.recognition import RecognitionStage
from kpred.training.recognition_config import RecognitionConfig
from kpred.training.recognition_data import prepare_recognition
from kpred.training.run import new_network

FRACTIONS = {"deformation": 0.35, "retrieval": 0.2, "partial": 0.45}
"""Of the time that is left after the data are prepared."""

PROBE, SETTLE = 40, 10
SAFETY = 0.93

FINE_RATE = 3e-4
"""Adam's rate where finished weights are trained on."""

PLUS = TrainConfig(
    deformation=StageConfig(batch=32),
    retrieval=StageConfig(batch=32),
    partial=StageConfig(batch=32),
    ranking_weight=0.5,
    checkpoint_every=100_000,
)
BLOCKS = 2
"""Of a fresh recognizer: with more it was worse on shapes of sources it has not seen."""

RECOGNITION = RecognitionConfig(optimisation=StageConfig(batch=192), points=320, checkpoint_every=100_000)


def main() -> None:
    """Parse the arguments and train."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("what", choices=["recognizer", "kp-red-plus", "kp-red"])
    parser.add_argument("packs", nargs="+", type=Path)
    parser.add_argument("-o", "--output", type=Path, required=True)
    parser.add_argument("--seconds", type=float, required=True)
    parser.add_argument("--start-from", default=None, help="go on from these weights: bundled, or a model's folder")
    parser.add_argument("--rate", type=float, default=None, help="Adam's first rate, of the recognizer")
    parser.add_argument("--limit", type=int, default=None, help="shapes a pack, for a trial")
    arguments = parser.parse_args()
    end = time.monotonic() + arguments.seconds
    torch.set_float32_matmul_precision("high")
    device = torch.device("cuda" if torch.cuda.is_available() else "cpu")
    packs = [_head(MeshPack.load(path), arguments.limit) for path in arguments.packs]
    if arguments.what == "recognizer":
        train_recognizer(packs, arguments.output, end, device, arguments.start_from, arguments.rate)
    else:
        train_category(arguments.what, packs, arguments.output, end, device, arguments.start_from)


def train_category(
    what: str, packs: list[MeshPack], folder: Path, end: float, device: torch.device, start_from: str | None = None
) -> None:
    """All stages of one category's networks, by `end` on the monotonic clock; fresh, or on from finished weights."""
    model = preset(what, packs[0].category)
    config = PLUS if what == "kp-red-plus" else dataclasses.replace(PAPER, checkpoint_every=100_000)
    network = new_network(model, config.seed)
    if start_from is not None:
        network.load_state_dict(load_model(start_from)[model.category].state_dict())
        config = finer(config)
    network.to(device)
    began = time.monotonic()
    data = prepare(packs, network, config.points, config.seed, device, batch=64)
    _say(folder, f"{len(data.targets)} shapes, prepared in {time.monotonic() - began:.0f} s")
    shares = dict(FRACTIONS)
    for stage in FRACTIONS:
        seconds = (end - time.monotonic()) * shares[stage] / sum(shares.values())
        del shares[stage]
        a_step = _seconds_a_step(network, data, config, stage)
        steps = max(PROBE, int((seconds - 2 * PROBE * a_step) / a_step * SAFETY))
        config = dataclasses.replace(config, **{stage: dataclasses.replace(getattr(config, stage), steps=steps)})
        _say(folder, f"{stage}: {1000 * a_step:.1f} ms a step, {steps} steps")
        losses: dict[str, float] = {}
        report = partial(_keep, losses)
        if start_from is None:
            train_stage(network, data, config, stage, folder, report, log=False)
        else:
            train_on(network, data, config, stage, folder, report)
        _say(folder, f"{stage}: {losses}")
        record = {
            "model": model.to_dict(),
            "stages": [name for name in FRACTIONS if name not in shares],
            "start_from": start_from,
            "training": config.to_dict(),
            "shapes": {"packs": [len(p) for p in packs], "sources": len(data.sources), "targets": len(data.targets)},
        }
        _write(folder / "model" / "training.json", record)
    _say(folder, f"{end - time.monotonic():.0f} s left")


def finer(config: TrainConfig) -> TrainConfig:
    """Return settings to train finished weights on: smaller steps, and nothing of how a training begins."""
    stages = {
        stage: dataclasses.replace(getattr(config, stage), learning_rate=FINE_RATE, schedule="cosine")
        for stage in FRACTIONS
    }
    return dataclasses.replace(config, warmup=0, late_step=0, **stages)


def train_on(network: KPRed, data: Any, config: TrainConfig, stage: str, folder: Path, report: Any) -> None:
    """Train a stage of finished weights without starting its networks over, as `train_stage` would."""
    work = STAGE_CLASSES[stage](network, data, config)
    work.start = lambda: None  # type: ignore[method-assign]
    optimise(work, None, folder, data.device, sorted(STAGE_CLASSES).index(stage), report, log=False)
    save_network(network, folder / "model")


def train_recognizer(
    packs: list[MeshPack],
    folder: Path,
    end: float,
    device: torch.device,
    start_from: str | None = None,
    rate: float | None = None,
) -> None:
    """Train the recognizer until `end` on the monotonic clock; fresh, or on from finished weights."""
    began = time.monotonic()
    data = prepare_recognition(packs, RECOGNITION.seed, device)
    _say(folder, f"{len(data.clouds)} shapes, prepared in {time.monotonic() - began:.0f} s")
    network = recognizer(data.categories, start_from).to(device)
    architecture = network.config
    rate = rate or (RECOGNITION.optimisation.learning_rate if start_from is None else FINE_RATE)
    probe = RecognitionStage(copy.deepcopy(network), data, RECOGNITION)
    a_step = _timed(probe, device)
    steps = max(PROBE, int((end - time.monotonic()) / a_step * SAFETY))
    _say(folder, f"recognition: {1000 * a_step:.1f} ms a step, {steps} steps")
    optimisation = dataclasses.replace(RECOGNITION.optimisation, steps=steps, learning_rate=rate)
    config = dataclasses.replace(RECOGNITION, optimisation=optimisation)
    losses: dict[str, float] = {}
    report = partial(_keep, losses)
    work = RecognitionStage(network, data, config)
    optimise(work, None, folder, device, 3, report, log=False)
    save_recognizer(network, folder / "model")
    numbers = torch.bincount(data.category, minlength=len(data.categories) + 1).tolist()
    record = {
        "model": architecture.to_dict(),
        "start_from": start_from,
        "training": config.to_dict(),
        "shapes": dict(zip((*data.categories, "other"), numbers, strict=True)),
    }
    _write(folder / "model" / "training.json", record)
    _say(folder, f"recognition: {losses}; {end - time.monotonic():.0f} s left")


def recognizer(categories: tuple[str, ...], start_from: str | None) -> Recognizer:
    """Make a fresh recognizer, or load a finished one that goes on."""
    earlier = None if start_from is None else finished(start_from)
    blocks = {"blocks": BLOCKS} if earlier is None else {"width": earlier.config.width, "blocks": earlier.config.blocks}
    with torch.random.fork_rng(devices=[]):
        torch.manual_seed(RECOGNITION.seed)
        network = Recognizer(RecognizerConfig(categories=categories, **blocks))
    if earlier is not None:
        if earlier.config.categories != categories:
            raise SystemExit(f"{start_from} knows {earlier.config.categories}, but the packs show {categories}.")
        network.load_state_dict(earlier.state_dict())
    return network


def finished(start_from: str) -> Recognizer:
    """Load the recognizer of a bundled model, or the one in a folder."""
    found = load_model(start_from).recognizer if start_from in BUNDLED else load_recognizer(start_from)
    if found is None:
        raise SystemExit(f"{start_from} has no recognizer.")
    return found


def _keep(losses: dict[str, float], _stage: str, _done: int, _total: int, values: dict[str, float]) -> None:
    losses.update(values)


def _seconds_a_step(network: KPRed, data: Any, config: TrainConfig, stage: str) -> float:
    config = dataclasses.replace(config, warmup=0)
    return _timed(STAGE_CLASSES[stage](copy.deepcopy(network), data, config), data.device)


def _timed(work: Any, device: torch.device) -> float:
    """Median-like time of a training step: the mean of all but the first."""
    began = 0.0
    with tempfile.TemporaryDirectory() as scratch:

        def report(_stage: str, done: int, _total: int, _losses: dict[str, float]) -> None:
            nonlocal began
            if done == SETTLE:
                began = time.monotonic()

        settings = dataclasses.replace(work.settings, steps=PROBE)
        field = "optimisation" if isinstance(work, RecognitionStage) else work.name
        work.config = dataclasses.replace(work.config, **{field: settings})
        optimise(work, None, Path(scratch), device, 0, report, log=False)
    return (time.monotonic() - began) / (PROBE - SETTLE)


def _head(pack: MeshPack, limit: int | None) -> MeshPack:
    if limit is None or len(pack) <= limit:
        return pack
    meshes = [pack[i] for i in range(limit)]
    names, splits = [str(x) for x in pack.model_id[:limit]], [str(x) for x in pack.split[:limit]]
    return MeshPack.from_meshes(meshes, names, splits, pack.category)


def _say(folder: Path, line: str) -> None:
    print(f"{folder.name}: {line}", flush=True)


def _write(path: Path, values: dict[str, Any]) -> None:
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(json.dumps(values, indent=2) + "\n")


if __name__ == "__main__":
    main()
