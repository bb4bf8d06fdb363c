"""Building a database, a training step, and starting up, each beside the plain way."""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import torch

from kpred.bench.figure import Figure, load, seconds, timed_figure
from kpred.database import build_database
from kpred.database.encode import prepare_mesh
from kpred.nn import Model, preset
from kpred.ops import icosphere
from kpred.ops.mean_value import mean_value_reference
from kpred.synthetic.generator import generate
from kpred.training.config import StageConfig, TrainConfig
from kpred.training.data import prepare
from kpred.training.losses import DeformationStage
from kpred.training.run import new_network


def build_figure(model: Model, work: Path, models: int = 48) -> Figure:
    """Measure models built per second, also with mean value coordinates in plain torch."""
    category = model.categories[0]
    pack = generate(category, models, seed=11, splits=False)
    shapes = [(str(name), category, "source", mesh) for name, mesh in zip(pack.model_id, pack, strict=True)]
    file = work / "build.kpred"
    build_database(file, shapes[:16], model, resume=False)
    taken = seconds(lambda: build_database(file, shapes, model, resume=False), 1, warm=0)[0]
    file.unlink()
    network = model[category]
    points = torch.stack([prepare_mesh(mesh, name, 0).points for name, _, _, mesh in shapes[:8]])
    faces = icosphere(network.config.cage_subdivisions)[1]
    plain = seconds(lambda: mean_value_reference(points, network.cage(points), faces), 1, warm=0)[0]
    slow = models / (taken + plain * models / len(points))
    rate = models / taken
    what = "coordinates of the points again in plain torch"
    return Figure("database build", rate, "models/s", 20.0, 1, rate, what, slow, load(), higher_is_better=True)


def training_figure(steps: int = 5, batch: int = 16) -> Figure:
    """Measure seconds of a deformation step, also with the sources' coordinates recomputed in plain torch."""
    config = TrainConfig(deformation=StageConfig(batch=batch), warmup=0)
    network = new_network(preset("kp-red-plus", "chair"), seed=0)
    data = prepare([generate("chair", 40, seed=0)], network, config.points, seed=0)
    stage = DeformationStage(network, data, config)
    optimizer = torch.optim.Adam(stage.parameters(), lr=1e-3)
    generator = torch.Generator().manual_seed(0)
    faces = icosphere()[1]

    def step() -> None:
        loss = torch.stack(list(stage.losses(2000, generator).values())).sum()
        optimizer.zero_grad()
        loss.backward()
        optimizer.step()

    times = seconds(step, steps)
    points = data.points[:batch]
    plain = seconds(lambda: mean_value_reference(points, network.cage(points), faces), 1, warm=0)[0]
    name = f"training step, batch {batch} (deformation)"
    what = "coordinates again in plain torch"
    return timed_figure(name, times, 0.25, what, [t + plain for t in times], scale=1.0, unit="s")


def start_figures() -> Iterator[Figure]:
    """Measure seconds of `import kpred` and `kpred --help`, beside Python alone."""

    def python(*words: str) -> None:
        subprocess.run([sys.executable, *words], check=True, capture_output=True)

    bare = seconds(lambda: python("-c", "pass"), 5)
    baseline = "python -c pass"
    imported = seconds(lambda: python("-c", "import kpred"), 5)
    yield timed_figure("import kpred", imported, 0.3, baseline, bare, scale=1.0, unit="s")
    helped = seconds(lambda: python("-m", "kpred", "--help"), 5)
    yield timed_figure("kpred --help", helped, 0.5, baseline, bare, scale=1.0, unit="s")
