"""Train the retrieval stage of ablation rows at several learning rates, and measure what it retrieves.

    python scripts/measure_retrieval_rate.py PACKS/chair.npz --model MODELS/chair --rows d e f --rates 1e-2 1e-3

Keypoints and influence are those of MODELS/chair for every row, and frozen, so that rows differ by their retrieval
alone. Targets that measure are held out of `train`; `val` is not read. A line for each training: row, rate, seconds of
the processor's time, mean loss of the first and of the last fifth of steps, and the mean Chamfer distance of held-out
targets after deformation (unit box squared): best of ten retrieved, best of ten at random, best of all.
"""

from __future__ import annotations

import argparse
import dataclasses
import time
from pathlib import Path

import torch
from torch import nn

from kpred.nn import STAGES, KPRed
from kpred.nn.loading import load_network
from kpred.ops import chamfer_distance
from kpred.shapes.pack import MeshPack
from kpred.training.ablations import rows_named
from kpred.training.config import PAPER, StageConfig
from kpred.training.data import TrainingData, prepare
from kpred.training.loop import GRADIENT_NORM, learning_rate
from kpred.training.losses import RetrievalStage
from kpred.training.run import new_network

TOP_K = 10
FEW = 512
"""Points of both clouds in a measurement."""


def main() -> None:
    """Parse the arguments, train and measure."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("pack", type=Path)
    parser.add_argument("--model", type=Path, required=True, help="one category's networks")
    parser.add_argument("--rows", nargs="+", default=["d", "e", "f"])
    parser.add_argument("--rates", nargs="+", type=float, default=[1e-2, 1e-3])
    parser.add_argument("--schedule", choices=("constant", "cosine"), default="constant")
    parser.add_argument("--steps", type=int, default=300)
    parser.add_argument("--sources", type=int, default=None)
    parser.add_argument("--targets", type=int, default=300)
    parser.add_argument("--held-out", type=int, default=32)
    parser.add_argument("--points", type=int, default=1024)
    arguments = parser.parse_args()
    trained = load_network(arguments.model)
    pack = _few(MeshPack.load(arguments.pack), arguments.sources, arguments.targets + arguments.held_out)
    data = prepare([pack], trained, arguments.points, 0, "cpu", "source")
    held = data.targets[-arguments.held_out :]
    data = dataclasses.replace(data, targets=data.targets[: -arguments.held_out])
    for row in rows_named(arguments.rows):
        for rate in arguments.rates:
            settings = StageConfig(arguments.steps, 16, rate, arguments.schedule)
            config = dataclasses.replace(PAPER, retrieval=settings, points=arguments.points)
            network = new_network(row.changed(dataclasses.replace(trained.config, self_attention=True)), 0)
            for part in STAGES["deformation"]:
                getattr(network, part).load_state_dict(getattr(trained, part).state_dict())
            began = time.process_time()
            stage = RetrievalStage(network, data, config)
            losses = train(stage, settings)
            spent, fifth = time.process_time() - began, max(1, len(losses) // 5)
            ends = [sum(some) / len(some) for some in (losses[:fifth], losses[-fifth:])]
            errors = measured(network, stage, data, held, arguments.points)
            numbers = [*(f"{loss:.2f}" for loss in ends), *(f"{error:.5f}" for error in errors)]
            print(row.name, rate, arguments.schedule, f"{spent:.0f}", *numbers, flush=True)


def train(stage: RetrievalStage, settings: StageConfig) -> list[float]:
    """Train in place, and return each step's loss."""
    generator = torch.Generator().manual_seed(0)
    weights = list(stage.parameters())
    optimizer = torch.optim.Adam(weights, lr=settings.learning_rate)
    history = []
    for step in range(settings.steps):
        for group in optimizer.param_groups:
            group["lr"] = learning_rate(settings, step)
        loss = torch.stack(list(stage.losses(step, generator).values())).sum()
        optimizer.zero_grad(set_to_none=True)
        loss.backward()
        nn.utils.clip_grad_norm_(weights, GRADIENT_NORM)
        optimizer.step()
        history.append(float(loss.detach()))
    return history


@torch.inference_mode()
def measured(
    network: KPRed, stage: RetrievalStage, data: TrainingData, held: torch.Tensor, points: int
) -> tuple[float, float, float]:
    """Compute the mean CD of the best of ten retrieved, of ten random and of all sources, unit box squared."""
    generator = torch.Generator().manual_seed(1)
    targets = data.clouds(held, points, generator)
    keypoints = network.keypoints(targets)
    tokens = network.retrieval_tokens(data.points, stage.source_keypoints)
    wanted = network.retrieval_tokens(targets, keypoints)
    found = []
    for target, place, token in zip(targets, keypoints, wanted, strict=True):
        displacement = place - stage.source_keypoints
        deformed = data.points[:, :FEW] + stage.bases[:, :FEW].float() @ displacement
        error = chamfer_distance(target[None, :FEW].expand(len(deformed), -1, -1), deformed)
        order = (tokens - token).abs().sum(-1).mean(-1).argsort()
        drawn = torch.randperm(len(error), generator=generator)
        found.append(torch.stack([error[order[:TOP_K]].min(), error[drawn[:TOP_K]].min(), error.min()]))
    retrieved, drawn, best = torch.stack(found).mean(0).tolist()
    return retrieved, drawn, best


def _few(pack: MeshPack, sources: int | None, targets: int) -> MeshPack:
    rows = [
        int(row) for split, count in (("source", sources), ("train", targets)) for row in pack.indices(split)[:count]
    ]
    names, splits = [str(pack.model_id[row]) for row in rows], [str(pack.split[row]) for row in rows]
    return MeshPack.from_meshes([pack[row] for row in rows], names, splits, pack.category)


if __name__ == "__main__":
    main()
