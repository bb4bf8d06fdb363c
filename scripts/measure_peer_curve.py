"""Train a peer on one category, and measure it again and again: best of ten retrieved, on targets of train and of val.

    python scripts/measure_peer_curve.py u-red PACKS/chair.npz -o RUN --steps 8000 --batch 16 --points 256 --every 500

RUN/curve.csv has one row for each measurement: steps, seconds of the processor's time, the mean deformation loss since
the row before, the mean Chamfer distance (unit box squared) of targets of both splits, and that of their nearest
undeformed source. The same command goes on where a stopped run was. Targets of `val` are only reported: nothing is
chosen by them.
"""

from __future__ import annotations

import argparse
import csv
import json
import time
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import torch

from kpred.evaluation.methods.method import Query
from kpred.evaluation.methods.sources import Sources
from kpred.evaluation.tables.targets import Target, read_targets
from kpred.peers.methods.peers import METHODS
from kpred.peers.networks.loading import PEERS
from kpred.peers.training.config import (
    KeypointDeformerTraining,
    NeuralCagesTraining,
    PeerTraining,
    ShapeFlowTraining,
    URedTraining,
    Uy2021Training,
)
from kpred.peers.training.run import Prepared, prepare_peer, run_peer
from kpred.shapes.pack import MeshPack
from kpred.training.config import StageConfig

TRAININGS: dict[str, type[PeerTraining]] = {
    "keypoint-deformer": KeypointDeformerTraining,
    "neural-cages": NeuralCagesTraining,
    "uy2021": Uy2021Training,
    "u-red": URedTraining,
    "shapeflow": ShapeFlowTraining,
}
SPLITS = ("train", "val")
DEFORMATION_LOSSES = ("similarity", "deformation")
TOP_K = 10


def main() -> None:
    """Parse the arguments, train and measure."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("peer", choices=list(TRAININGS))
    parser.add_argument("pack", type=Path)
    parser.add_argument("-o", "--output", type=Path, required=True)
    parser.add_argument("--steps", type=int, required=True)
    parser.add_argument("--batch", type=int, default=16)
    parser.add_argument("--rate", type=float, default=1e-3)
    parser.add_argument("--points", type=int, default=256, help="of each cloud in a step")
    parser.add_argument("--precision", choices=("float32", "bfloat16"), default="float32")
    parser.add_argument("--network", nargs="*", default=[], metavar="NAME=VALUE", help="settings of the network")
    parser.add_argument("--training", nargs="*", default=[], metavar="NAME=VALUE", help="settings of the training")
    parser.add_argument("--every", type=int, default=500, help="steps between measurements")
    parser.add_argument("--count", type=int, default=24, help="targets of each split in a measurement")
    arguments = parser.parse_args()
    config = TRAININGS[arguments.peer](
        optimisation=StageConfig(arguments.steps, arguments.batch, arguments.rate),
        points=arguments.points,
        precision=arguments.precision,
        **_settings(arguments.training),
    )
    pack = MeshPack.load(arguments.pack)
    prepared = prepare_peer([pack], PEERS[arguments.peer][1](**_settings(arguments.network)), config)
    with Sources.of_pack(pack, str(arguments.pack), 0, print) as sources:
        targets = [read_targets(pack, str(arguments.pack), split, arguments.count, 0, print) for split in SPLITS]
        train(prepared, config, arguments.output, sources, targets, arguments.every)


def train(
    prepared: Prepared,
    config: PeerTraining,
    folder: Path,
    sources: Sources,
    targets: Sequence[Sequence[Target]],
    every: int,
) -> None:
    """Train, and add a row to `curve.csv` at every so many steps and at the end."""
    method = METHODS[type(prepared.network)]("peer", {sources.category: prepared.network})
    before = _measured_seconds(folder)
    began = time.process_time()

    recent: list[float] = []

    def report(_stage: str, done: int, total: int, losses: dict[str, float]) -> None:
        recent.append(losses[next(name for name in DEFORMATION_LOSSES if name in losses)])
        if done % every and done != total:
            return
        spent = before + time.process_time() - began
        errors = [measured(method, sources, some) for some in targets]
        numbers = [sum(recent) / len(recent), *(value for pair in errors for value in pair)]
        recent.clear()
        row = [str(done), f"{spent:.0f}", *(f"{value:.5f}" for value in numbers)]
        _append(folder / "curve.csv", row)
        print(*row, flush=True)

    run_peer(prepared, config, folder, report, log=False)


@torch.inference_mode()
def measured(method: Any, sources: Sources, targets: Sequence[Target]) -> tuple[float, float]:
    """Compute the mean CD of the best of ten, and that of the nearest undeformed source, unit box squared."""
    searcher = method.over(sources)
    found, undeformed = 0.0, 0.0
    for target in targets:
        for prediction in searcher.predict(Query(target.model_id, target.points, False, (TOP_K,))):
            found += prediction.error / len(targets)
        undeformed += float(sources.undeformed_errors(target.points, False).min()) / len(targets)
    return found, undeformed


def _settings(given: Sequence[str]) -> dict[str, Any]:
    pairs = [one.split("=", 1) for one in given]
    return {name: json.loads(value) for name, value in pairs}


def _measured_seconds(folder: Path) -> float:
    try:
        return float((folder / "curve.csv").read_text().splitlines()[-1].split(",")[1])
    except (OSError, IndexError, ValueError):
        return 0.0


def _append(file: Path, row: Sequence[Any]) -> None:
    file.parent.mkdir(parents=True, exist_ok=True)
    names = ["step", "seconds", "loss", *(f"{split}{kind}" for split in SPLITS for kind in ("", "_undeformed"))]
    fresh = not file.exists()
    with file.open("a", newline="") as stream:
        writer = csv.writer(stream)
        if fresh:
            writer.writerow(names)
        writer.writerow(row)


if __name__ == "__main__":
    main()
