"""A peer's whole training: data, the stage, weights and their record in one run folder."""

from __future__ import annotations

from collections.abc import Callable, Sequence, Sized
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import torch

from kpred.errors import PackError
from kpred.json_output import write_json
from kpred.nn import KPRed
from kpred.peers.networks.keypoint_deformer import KeypointDeformer, KeypointDeformerConfig
from kpred.peers.networks.loading import peer_name, save_peer
from kpred.peers.networks.neural_cages import NeuralCages, NeuralCagesConfig
from kpred.peers.networks.shapeflow import ShapeFlow, ShapeFlowConfig
from kpred.peers.networks.u_red import URed, URedConfig
from kpred.peers.networks.uy2021 import Uy2021, Uy2021Config
from kpred.peers.training.config import (
    KeypointDeformerTraining,
    NeuralCagesTraining,
    PeerTraining,
    ShapeFlowTraining,
    URedTraining,
    Uy2021Training,
)
from kpred.peers.training.keypoint_deformer import KeypointDeformerStage
from kpred.peers.training.neural_cages import NeuralCagesStage
from kpred.peers.training.part_sources import read_part_sources, refuse_twins
from kpred.peers.training.shapeflow import ShapeFlowStage
from kpred.peers.training.u_red import URedStage
from kpred.peers.training.uy2021 import Uy2021Stage
from kpred.shapes.pack import MeshPack
from kpred.training.data import Progress, TrainingData, prepare
from kpred.training.loop import StepReport
from kpred.training.single_stage import SingleStage
from kpred.training.single_stage_run import RECORD, fresh_network, run_stage

STREAM = 4
"""Which of the random streams of one seed is the peers'."""

SOURCE_SPLIT = "source"

Device = torch.device | str


@dataclass(frozen=True)
class Prepared:
    """A training that is ready to begin.

    Attributes:
        network: fresh, on its device; shapes: numbers of sources and targets, for the record.
        stage: makes the work of the loop; the settings may have other steps than those it was prepared with.
    """

    network: Any
    stage: Callable[[Any], SingleStage[Any]]
    shapes: dict[str, int]


def prepare_peer(
    packs: Sequence[MeshPack],
    model: Any,
    config: PeerTraining,
    device: Device = "cpu",
    progress: Progress | None = None,
) -> Prepared:
    """Read the splits source and train of one category and make a peer's fresh network.

    Args:
        model: the peer's config, which says which peer it is; its category and shapes are those of the packs.

    Raises:
        PackError: if the packs are of several categories or hold too few shapes.
    """
    found = sorted({pack.category for pack in packs})
    if len(found) != 1:
        raise PackError(f"A run trains one category, but was given {', '.join(found) or 'no pack'}; give packs of one.")
    return _PREPARATIONS[type(model)](packs, replace(model, category=found[0]), config, device, progress)


def train_peer(
    packs: Sequence[MeshPack],
    model: Any,
    config: PeerTraining,
    folder: Path,
    device: Device = "cpu",
    progress: Progress | None = None,
    report: StepReport | None = None,
    resume: bool = True,
) -> Any:
    """Train a peer on the splits source and train of one category; weights go to `folder/model`.

    A stopped training goes on where it was.

    Args:
        model, config: the peer's own, which say which peer it is.

    Raises:
        PackError: if the packs are of several categories or hold too few shapes.
        CheckpointError: if the folder holds a run with other settings or sources.
        OutputError: if the folder cannot be written.
    """
    prepared = prepare_peer(packs, model, config, device, progress)
    run_peer(prepared, config, folder, report, resume)
    return prepared.network


def run_peer(
    prepared: Prepared,
    config: PeerTraining,
    folder: Path,
    report: StepReport | None = None,
    resume: bool = True,
    log: bool = True,
) -> None:
    """Run a prepared training, and write the weights with their record.

    Raises:
        CheckpointError: if the folder holds a run with other settings or sources.
        OutputError: if the folder cannot be written.
    """
    run_stage(prepared.stage(config), folder, STREAM, report, resume, log=log)
    keep(prepared, config, folder)


def keep(prepared: Prepared, config: PeerTraining, folder: Path, steps: int | None = None) -> None:
    """Write weights and their record to `folder/model`; `steps` says how many were done where not all were.

    Raises:
        OutputError: if the folder cannot be written.
    """
    network = prepared.network
    save_peer(network, folder / "model")
    values: dict[str, Any] = {
        "peer": peer_name(network),
        "category": network.config.category,
        "training": config.to_dict(),
        "shapes": prepared.shapes,
    }
    if steps is not None:
        values["stopped_after"] = steps
    write_json(folder / "model" / RECORD, values)


def _keypoint_deformer(
    packs: Sequence[MeshPack],
    model: KeypointDeformerConfig,
    config: KeypointDeformerTraining,
    device: Device,
    progress: Progress | None,
) -> Prepared:
    network = fresh_network(lambda: KeypointDeformer(model), config.seed).to(device)
    # The preparation uses only the network's cages, which are the same here.
    data = prepare(list(packs), KPRed(model.model_config()), config.points, config.seed, device, progress=progress)
    return Prepared(network, lambda c: KeypointDeformerStage(network, data, c), _count(data, data.sources))


def _neural_cages(
    packs: Sequence[MeshPack],
    model: NeuralCagesConfig,
    config: NeuralCagesTraining,
    device: Device,
    progress: Progress | None,
) -> Prepared:
    network = fresh_network(lambda: NeuralCages(model), config.seed).to(device)
    data = prepare(list(packs), None, config.points, config.seed, device, progress=progress)
    return Prepared(network, lambda c: NeuralCagesStage(network, data, c), _count(data, data.sources))


def _uy2021(
    packs: Sequence[MeshPack], model: Uy2021Config, config: Uy2021Training, device: Device, progress: Progress | None
) -> Prepared:
    sources = read_part_sources(packs, model.parts, config.seed, SOURCE_SPLIT, progress).to(device)
    network = fresh_network(lambda: Uy2021(replace(model, sources=sources.model_ids)), config.seed).to(device)
    data = prepare(list(packs), None, config.points, config.seed, device, SOURCE_SPLIT, progress)
    return Prepared(network, lambda c: Uy2021Stage(network, data, sources, c), _count(data, sources.points))


def _u_red(
    packs: Sequence[MeshPack], model: URedConfig, config: URedTraining, device: Device, progress: Progress | None
) -> Prepared:
    sources = read_part_sources(packs, model.parts, config.seed, SOURCE_SPLIT, progress).to(device)
    network = fresh_network(lambda: URed(model), config.seed).to(device)
    data = prepare(list(packs), None, config.points, config.seed, device, SOURCE_SPLIT, progress)
    return Prepared(network, lambda c: URedStage(network, data, sources, c), _count(data, sources.points))


def _shapeflow(
    packs: Sequence[MeshPack],
    model: ShapeFlowConfig,
    config: ShapeFlowTraining,
    device: Device,
    progress: Progress | None,
) -> Prepared:
    data = prepare(list(packs), None, config.points, config.seed, device, SOURCE_SPLIT, progress)
    refuse_twins(data.model_ids)
    network = fresh_network(lambda: ShapeFlow(replace(model, sources=data.model_ids)), config.seed).to(device)
    return Prepared(network, lambda c: ShapeFlowStage(network, data, c), _count(data, data.sources))


def _count(data: TrainingData, sources: Sized) -> dict[str, int]:
    return {"sources": len(sources), "targets": len(data.targets)}


_PREPARATIONS: dict[type[Any], Callable[..., Prepared]] = {
    KeypointDeformerConfig: _keypoint_deformer,
    NeuralCagesConfig: _neural_cages,
    Uy2021Config: _uy2021,
    URedConfig: _u_red,
    ShapeFlowConfig: _shapeflow,
}
