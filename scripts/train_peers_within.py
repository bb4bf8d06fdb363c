"""Train a peer on one category in a given time, on a machine with nothing but torch, numpy and safetensors.

    python scripts/train_peers_within.py uy2021 PACKS/chair.npz -o RUN --seconds 400

Steps are timed first, as fast as they are beside all else that runs, so that the schedule comes to its end in time. A
training that is not done by then is stopped, and RUN/model/training.json says after how many steps. Only weights and
their record are kept.
"""

from __future__ import annotations

import argparse
import dataclasses
import shutil
import tempfile
import time
from pathlib import Path
from typing import Any

import torch

from kpred.peers.networks.loading import PEERS
from kpred.peers.training.config import (
    KeypointDeformerTraining,
    NeuralCagesTraining,
    PeerTraining,
    ShapeFlowTraining,
    URedTraining,
    Uy2021Training,
)
from kpred.peers.training.run import Prepared, keep, prepare_peer, run_peer
from kpred.shapes.pack import MeshPack
from kpred.training.config import StageConfig
from kpred.training.loop import optimise

NEVER = 10**9

SETTINGS: dict[str, PeerTraining] = {
    "keypoint-deformer": KeypointDeformerTraining(optimisation=StageConfig(batch=32), checkpoint_every=NEVER),
    "neural-cages": NeuralCagesTraining(optimisation=StageConfig(batch=16), checkpoint_every=NEVER),
    "uy2021": Uy2021Training(optimisation=StageConfig(batch=16), points=512, checkpoint_every=NEVER),
    "u-red": URedTraining(optimisation=StageConfig(batch=32), points=512, checkpoint_every=NEVER),
    "shapeflow": ShapeFlowTraining(optimisation=StageConfig(batch=32), checkpoint_every=NEVER),
}
"""Batches that a GPU takes about as fast as smaller ones."""

PROBE, SETTLE = 30, 10
SAFETY = 0.92


class OutOfTime(Exception):
    """The time is over before the last step."""


def main() -> None:
    """Parse the arguments and train."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("peer", choices=list(SETTINGS))
    parser.add_argument("packs", nargs="+", type=Path)
    parser.add_argument("-o", "--output", type=Path, required=True)
    parser.add_argument("--seconds", type=float, required=True)
    parser.add_argument("--limit", type=int, default=None, help="shapes of each split of a pack, for a trial")
    arguments = parser.parse_args()
    began = time.monotonic()
    end = began + arguments.seconds
    folder, config = arguments.output, SETTINGS[arguments.peer]
    torch.set_float32_matmul_precision("high")
    device = torch.device("cuda" if torch.cuda.is_available() else "cpu")
    packs = [_head(MeshPack.load(path), arguments.limit) for path in arguments.packs]
    prepared = prepare_peer(packs, PEERS[arguments.peer][1](), config, device)
    _say(folder, f"{prepared.shapes}, prepared in {time.monotonic() - began:.0f} s")
    a_step = _seconds_a_step(prepared, config, device)
    steps = max(PROBE, int((end - time.monotonic()) / a_step * SAFETY))
    config = dataclasses.replace(config, optimisation=dataclasses.replace(config.optimisation, steps=steps))
    _say(folder, f"{1000 * a_step:.1f} ms a step, {steps} steps")
    last: dict[str, float] = {}
    reached = 0

    def report(_stage: str, done: int, total: int, losses: dict[str, float]) -> None:
        nonlocal reached
        reached = done
        last.update(losses)
        if time.monotonic() > end and done < total:
            raise OutOfTime

    with tempfile.TemporaryDirectory() as scratch:
        try:
            run_peer(prepared, config, Path(scratch), report, log=False)
        except OutOfTime:
            keep(prepared, config, Path(scratch), reached)
        shutil.copytree(Path(scratch) / "model", folder / "model", dirs_exist_ok=True)
    _say(folder, f"{reached} steps, {last}; {end - time.monotonic():.0f} s left")


def _seconds_a_step(prepared: Prepared, config: PeerTraining, device: torch.device) -> float:
    """Mean time of a training step but for the first ones; the network is afterwards as it was."""
    before = {key: value.clone() for key, value in prepared.network.state_dict().items()}
    began = 0.0

    def report(_stage: str, done: int, _total: int, _losses: dict[str, float]) -> None:
        nonlocal began
        if done == SETTLE:
            began = time.monotonic()

    optimisation = dataclasses.replace(config.optimisation, steps=PROBE)
    changed: dict[str, Any] = {"optimisation": optimisation}
    if hasattr(config, "warmup"):  # whose steps are quicker
        changed["warmup"] = 0
    with tempfile.TemporaryDirectory() as scratch:
        work = prepared.stage(dataclasses.replace(config, **changed))
        optimise(work, None, Path(scratch), device, 0, report, log=False)
    seconds = (time.monotonic() - began) / (PROBE - SETTLE)
    prepared.network.load_state_dict(before)
    return seconds


def _head(pack: MeshPack, limit: int | None) -> MeshPack:
    if limit is None:
        return pack
    rows = [int(row) for split in ("source", "train") for row in pack.indices(split)[:limit]]
    names, splits = [str(pack.model_id[row]) for row in rows], [str(pack.split[row]) for row in rows]
    return MeshPack.from_meshes([pack[row] for row in rows], names, splits, pack.category)


def _say(folder: Path, line: str) -> None:
    print(f"{folder.name}: {line}", flush=True)


if __name__ == "__main__":
    main()
