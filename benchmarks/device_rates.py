"""Fits and training steps per second on a device, beside its peak; needs torch, numpy and safetensors only."""

from __future__ import annotations

import statistics
from collections.abc import Callable, Iterator
from dataclasses import asdict, dataclass, replace
from typing import Any

import torch
from batched_fits import ModelTable, ScanBatch
from torch import Tensor
from traffic import Cost, Peaks, cost_of, peaks, times

from kpred.nn import STAGES, KPRed, load_model, preset
from kpred.refinement.config import RefineConfig
from kpred.shapes.pack import MeshPack
from kpred.synthetic.generator import generate
from kpred.training.config import PAPER, TrainConfig
from kpred.training.data import TrainingData, prepare
from kpred.training.losses import STAGE_CLASSES, RetrievalStage
from kpred.training.run import new_network

POINTS = 2048

FIGURES = 8
"""How many there are: two ways of fitting, three stages of two models."""


@dataclass(frozen=True)
class Rate:
    """One figure.

    Attributes:
        name: what was done; rate: how many a second, by the median time; seconds: that time, of one run.
        each: what one is, and how many a run makes; cost: of a run.
        arithmetic, memory: fractions of the time that the device would need at its peak for the one and for the other.
    """

    name: str
    rate: float
    seconds: float
    best: float
    each: str
    cost: Cost
    arithmetic: float
    memory: float

    def to_json(self) -> dict[str, Any]:
        """Return plain values for JSON."""
        return asdict(self)


@dataclass(frozen=True)
class Sizes:
    """How much is measured: `batch` scans of a fit, `models` searched, `shapes` trained on, `repeats` of each."""

    batch: int = 256
    models: int = 1000
    top_k: int = 10
    shapes: int = 128
    repeats: int = 7
    matrix: int = 8192
    points: int = POINTS


def device_figures(device: torch.device, sizes: Sizes, report: Callable[[str], None]) -> tuple[Peaks, list[Rate]]:
    """Measure all figures of a device; `report` receives a line for each."""
    torch.set_float32_matmul_precision("high")
    peak = peaks(device, sizes.matrix)
    report(f"peaks: {peak.products:.3g} and {peak.plain:.3g} operations/s, {peak.traffic:.3g} bytes/s")
    found = []
    for rate in (*fit_rates(device, sizes, peak), *training_rates(device, sizes, peak)):
        report(f"{rate.name}: {rate.rate:.4g} {rate.each}/s")
        found.append(rate)
    return peak, found


def fit_rates(device: torch.device, sizes: Sizes, peak: Peaks) -> Iterator[Rate]:
    """Measure fits of full chairs in known frames by the bundled model: feed-forward, and keypoints refined."""
    network = load_model(None, device)["chair"]
    table = model_table(generate("chair", sizes.models, seed=7, splits=False), network, sizes, device)
    scans = scans_of(generate("chair", min(sizes.batch, 64), seed=99), sizes, device)
    config = RefineConfig()

    def feed_forward() -> Tensor:
        with torch.inference_mode():
            return ScanBatch.retrieved(scans, network, table, sizes.top_k, partial=False).errors()

    def refined() -> Tensor:
        with torch.inference_mode():
            found = ScanBatch.retrieved(scans, network, table, sizes.top_k, partial=False)
            return found.refined(config).errors()

    where = f"batch {sizes.batch}, {len(table.tokens)} models, top {sizes.top_k}"
    for name, work in (("fit, feed-forward", feed_forward), ("fit, keypoints refined", refined)):
        yield _rate(f"{name}, {where}", "fits", sizes.batch, work, device, sizes.repeats, peak)


def model_table(pack: MeshPack, network: KPRed, sizes: Sizes, device: torch.device) -> ModelTable:
    """Encode the shapes of a pack as a database stores them."""
    data = prepare([pack], network, sizes.points, 0, device, batch=64)
    made = RetrievalStage(network, data, TrainConfig())
    tokens = []
    with torch.inference_mode():
        for rows in torch.arange(len(data.points), device=device).split(64):
            tokens.append(network.retrieval_tokens(data.points[rows], made.source_keypoints[rows]))
    return ModelTable(torch.cat(tokens), made.source_keypoints, data.points, made.bases.float())


def scans_of(pack: MeshPack, sizes: Sizes, device: torch.device) -> Tensor:
    """Sample clouds (batch, points, 3) of shapes in their unit boxes, several of each shape."""
    data = prepare([pack], None, sizes.points, 1, device)
    generator = torch.Generator(device=device).manual_seed(0)
    rows = torch.arange(sizes.batch, device=device) % len(data.pool)
    return data.clouds(rows, sizes.points, generator)


def training_rates(device: torch.device, sizes: Sizes, peak: Peaks) -> Iterator[Rate]:
    """Measure steps of the three stages, of the bundled architecture and of the paper's."""
    pack = generate("chair", sizes.shapes, seed=3, splits=False)
    for name, config in (("kp-red-plus", TrainConfig(ranking_weight=0.5)), ("kp-red", PAPER)):
        config = replace(config, points=min(config.points, sizes.points), warmup=0)
        network = new_network(preset(name, "chair"), 0).to(device)
        data = prepare([pack], network, config.points, 0, device, batch=64)
        for stage in STAGES:
            work, batch = training_step(network, data, config, stage, device)
            title = f"{name}, training step of {stage}, batch {batch}, {config.points} points"
            yield _rate(title, "steps", 1, work, device, sizes.repeats, peak)


def training_step(
    network: KPRed, data: TrainingData, config: TrainConfig, stage: str, device: torch.device
) -> tuple[Callable[[], object], int]:
    """Prepare a training step as the loop runs it, and its batch."""
    made = STAGE_CLASSES[stage](network, data, config)
    made.start()
    optimizer = torch.optim.Adam(made.parameters(), lr=1e-4)
    generator = torch.Generator(device=device).manual_seed(0)

    def step() -> None:
        loss = torch.stack(list(made.losses(config.late_step, generator).values())).sum()
        optimizer.zero_grad(set_to_none=True)
        loss.backward()
        torch.nn.utils.clip_grad_norm_(made.parameters(), 1.0)
        optimizer.step()

    return step, made.settings.batch


def record_of(device: torch.device, sizes: Sizes, peak: Peaks, rates: list[Rate]) -> dict[str, Any]:
    """Return all figures as plain values for JSON."""
    name = torch.cuda.get_device_name(device) if device.type == "cuda" else "cpu"
    from kpred.ops import nearest

    return {
        "device": name,
        "torch": torch.__version__,
        "fused_search": device.type == "cuda" and nearest._fused() is not None,
        "precision": torch.get_float32_matmul_precision(),
        "peaks": asdict(peak),
        "sizes": asdict(sizes),
        "figures": [rate.to_json() for rate in rates],
    }


def _rate(
    name: str, each: str, count: int, work: Callable[[], object], device: torch.device, repeats: int, peak: Peaks
) -> Rate:
    found = times(work, device, repeats)
    middle = statistics.median(found)
    cost = cost_of(work)
    least = peak.seconds(cost)
    fractions = {key: value / middle for key, value in least.items()}
    return Rate(name, count / middle, middle, min(found), each, cost, fractions["arithmetic"], fractions["memory"])
