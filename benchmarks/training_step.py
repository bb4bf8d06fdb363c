"""How much a deformation step gains from constants cached per source, in one run.

    python benchmarks/training_step.py [--points 2048] [--steps 10]

Times the same training step (forward, backward, Adam) three times: with cage and mean value coordinates cached, with
both computed again in plain torch in every step (what a machine without numba does), and with both computed again by
the compiled kernel. Prints seconds a step (median) and the ratios to the cached step.
"""

from __future__ import annotations

import argparse
import json
import os
import statistics
import time
from collections.abc import Callable

import torch

from kpred.nn import preset
from kpred.ops import icosphere, mean_value_coordinates
from kpred.ops.mean_value import mean_value_reference
from kpred.shapes.synthetic.generator import generate
from kpred.training.config import StageConfig, TrainConfig
from kpred.training.data import TrainingData, prepare
from kpred.training.run import new_network
from kpred.training.stages import DeformationStage


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--points", type=int, default=TrainConfig().points)
    parser.add_argument("--steps", type=int, default=10)
    parser.add_argument("--batch", type=int, default=16)
    options = parser.parse_args()
    config = TrainConfig(deformation=StageConfig(batch=options.batch), points=options.points, warmup=0)
    network = new_network(preset("kp-red-plus", "chair"), seed=0)
    data = prepare([generate("chair", 40, seed=0)], network, options.points, seed=0)
    stage = DeformationStage(network, data, config)
    optimizer = torch.optim.Adam(stage.parameters(), lr=1e-3)
    generator = torch.Generator().manual_seed(0)
    faces = icosphere()[1]

    def step() -> None:
        loss = torch.stack(list(stage.losses(2000, generator).values())).sum()
        optimizer.zero_grad()
        loss.backward()
        optimizer.step()

    def constants(coordinates: Callable[..., torch.Tensor]) -> None:
        points = data.points[TrainingData.draw_sources(data, options.batch, generator)]
        coordinates(points, network.cage(points), faces)

    seconds = {"cached": [], "recomputed, plain torch": [], "recomputed, compiled": []}
    for _ in range(options.steps + 1):
        step_seconds = _timed(step)
        seconds["cached"].append(step_seconds)
        seconds["recomputed, plain torch"].append(step_seconds + _timed(lambda: constants(mean_value_reference)))
        seconds["recomputed, compiled"].append(step_seconds + _timed(lambda: constants(mean_value_coordinates)))
    medians = {name: statistics.median(values[1:]) for name, values in seconds.items()}
    result = {
        "batch": options.batch,
        "points": options.points,
        "threads": torch.get_num_threads(),
        "load": os.getloadavg()[0],
        "seconds_per_step": medians,
        "ratio_to_cached": {name: value / medians["cached"] for name, value in medians.items()},
    }
    print(json.dumps(result, indent=2))


def _timed(work: Callable[[], None]) -> float:
    started = time.perf_counter()
    work()
    return time.perf_counter() - started


if __name__ == "__main__":
    main()
