"""A peer's whole training: data, the stage, weights and their record in one run folder."""

from __future__ import annotations

import json
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import torch
from torch import nn

from kpred.errors import PackError
from kpred.nn import KPRed
from kpred.nn.peers.keypoint_deformer import KeypointDeformer, KeypointDeformerConfig
from kpred.nn.peers.loading import Peer, peer_name, save_peer
from kpred.nn.peers.uy2021 import Uy2021, Uy2021Config
from kpred.shapes.atomic import atomic_path
from kpred.shapes.pack import MeshPack
from kpred.training.data import Progress, prepare
from kpred.training.loop import StepReport, Work, optimise, resumable
from kpred.training.peers.config import KeypointDeformerTraining, PeerTraining, Uy2021Training
from kpred.training.peers.keypoint_deformer import KeypointDeformerStage
from kpred.training.peers.part_sources import read_part_sources
from kpred.training.peers.uy2021 import Uy2021Stage

STREAM = 4
"""Which of the random streams of one seed is the peers'."""

SOURCE_SPLIT = "source"


def train_keypoint_deformer(
    packs: Sequence[MeshPack],
    model: KeypointDeformerConfig,
    config: KeypointDeformerTraining,
    folder: Path,
    device: torch.device | str = "cpu",
    progress: Progress | None = None,
    report: StepReport | None = None,
    resume: bool = True,
) -> KeypointDeformer:
    """Train KeypointDeformer on the splits source and train of one category; weights go to `folder/model`.

    A stopped training goes on where it was.

    Raises:
        PackError: if the packs are of several categories or hold too few shapes.
        CheckpointError: if the folder holds a run with other settings.
        OutputError: if the folder cannot be written.
    """
    architecture = replace(model, category=_category(packs))
    network = _made(lambda: KeypointDeformer(architecture), config.seed).to(device)
    # The preparation asks the network for nothing but cages, and this one makes the same.
    cages = KPRed(architecture.model_config())
    data = prepare(list(packs), cages, config.points, config.seed, device, progress=progress)
    _train(network, KeypointDeformerStage(network, data, config), config, folder, data.device, report, resume)
    _record(network, config, folder, {"sources": len(data.sources), "targets": len(data.targets)})
    return network


def train_uy2021(
    packs: Sequence[MeshPack],
    model: Uy2021Config,
    config: Uy2021Training,
    folder: Path,
    device: torch.device | str = "cpu",
    progress: Progress | None = None,
    report: StepReport | None = None,
    resume: bool = True,
) -> Uy2021:
    """Train Uy et al. 2021: sources are the split source, targets the splits source and train of one category.

    Weights, codes of the sources among them, go to `folder/model`. A stopped training goes on where it was.

    Raises:
        PackError: if the packs are of several categories or hold too few shapes.
        CheckpointError: if the folder holds a run with other settings or sources.
        OutputError: if the folder cannot be written.
    """
    category = _category(packs)
    sources = read_part_sources(packs, model.parts, config.seed, SOURCE_SPLIT, progress).to(device)
    architecture = replace(model, category=category, sources=sources.model_ids)
    network = _made(lambda: Uy2021(architecture), config.seed).to(device)
    cages = KPRed(KeypointDeformerConfig(category).model_config())
    data = prepare(list(packs), cages, config.points, config.seed, device, SOURCE_SPLIT, progress)
    _train(network, Uy2021Stage(network, data, sources, config), config, folder, data.device, report, resume)
    _record(network, config, folder, {"sources": len(sources.model_ids), "targets": len(data.targets)})
    return network


def _category(packs: Sequence[MeshPack]) -> str:
    found = sorted({pack.category for pack in packs})
    if len(found) != 1:
        raise PackError(f"A run trains one category, but was given {', '.join(found) or 'no pack'}; give packs of one.")
    return found[0]


def _made(build: Callable[[], Any], seed: int) -> Any:
    """A fresh network; the caller's random state is left as it was."""
    with torch.random.fork_rng(devices=[]):
        torch.manual_seed(seed)
        return build()


def _train(
    network: nn.Module,
    work: Work,
    config: PeerTraining,
    folder: Path,
    device: torch.device,
    report: StepReport | None,
    resume: bool,
) -> None:
    checkpoint = resumable(folder, work.name, work.model_config(), config.to_dict(), device) if resume else None
    if checkpoint:
        network.load_state_dict(checkpoint.weights)
    optimise(work, checkpoint, folder, device, STREAM, report)


def _record(network: Peer, config: PeerTraining, folder: Path, shapes: dict[str, int]) -> None:
    save_peer(network, folder / "model")
    values = {"peer": peer_name(network), "training": config.to_dict(), "shapes": shapes}
    with atomic_path(folder / "model" / "training.json") as temporary:
        temporary.write_text(json.dumps(values, indent=2) + "\n")
