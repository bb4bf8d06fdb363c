"""`kpred train peer`: other published methods, on the same packs and in the same loop."""

from __future__ import annotations

import time
from abc import abstractmethod
from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated, Any, ClassVar

from tyro.conf import Positional, arg

from kpred.cli.command import Group
from kpred.cli.devices import found_device
from kpred.cli.output import Output
from kpred.cli.train_options import TrainingCommand, loss_note, resumable_training
from kpred.cli.usage import UsageError
from kpred.peers.training.config import (
    KeypointDeformerTraining,
    NeuralCagesTraining,
    PeerTraining,
    ShapeFlowTraining,
    URedTraining,
    Uy2021Training,
)


@dataclass(frozen=True, kw_only=True)
class _PeerCommand(TrainingCommand):
    """What the peers' commands share."""

    peer: ClassVar[str]

    packs: Annotated[Positional[tuple[Path, ...]], arg(metavar="PACK [PACK ...]", help_behavior_hint="")]
    """Mesh packs (.npz) of one category; the splits source and train are used"""
    output: Annotated[Path | None, arg(aliases=["-o"], metavar="FOLDER")] = None
    """Run folder: checkpoint, TensorBoard log, weights in FOLDER/model; without it, runs/PEER/CATEGORY"""
    training: Annotated[PeerTraining, arg(name="")] = field(default_factory=PeerTraining)

    def run(self, output: Output) -> None:
        """Train with a progress bar; print where the weights are."""
        from kpred.cli.processes import refuse
        from kpred.cli.progress import ProgressBar
        from kpred.peers.training.run import train_peer
        from kpred.shapes.pack import MeshPack

        refuse(f"`kpred train peer {self.peer}`")
        if not self.packs:
            raise UsageError(f"no pack was named; try `kpred train peer {self.peer} PACK.npz -o FOLDER`")
        packs = [MeshPack.load(path) for path in self.packs]
        self.limit_threads()
        folder = self.output if self.output is not None else Path("runs") / self.peer / packs[0].category
        last: dict[str, float] = {}
        began = time.perf_counter()
        with resumable_training(folder), ProgressBar() as bar:

            def report(stage: str, done: int, total: int, losses: dict[str, float]) -> None:
                last.update(losses)
                bar.update(stage, done, total, loss_note(losses))

            device = found_device(self.device)
            network = train_peer(packs, self.model(), self.training, folder, device, bar.update, report, self.resume)
        seconds = time.perf_counter() - began
        weights = folder / "model"
        facts = {"peer": self.peer, "model": weights, "category": network.config.category}
        output.result({**facts, "seconds": seconds, "last_losses": last})
        if last:
            output.table("last step", ["loss", "value"], list(last.items()))
        output.note(f"weights: {weights} ({seconds:.0f} s)")

    @abstractmethod
    def model(self) -> Any:
        """Return the config of the peer's network; category and shapes are those of the packs."""


@dataclass(frozen=True, kw_only=True)
class KeypointDeformerCommand(_PeerCommand):
    """Train KeypointDeformer (Jakab et al. 2021): keypoints move a cage, influence from a global feature.

    A run that was stopped (Ctrl-C, a killed machine) goes on exactly where it was when the same command is given again.

    examples:
      kpred train peer keypoint-deformer chair.npz -o runs/keypoint-deformer/chair
      kpred train peer keypoint-deformer chair.npz -o runs/short --optimisation.steps 1500
    """

    peer: ClassVar[str] = "keypoint-deformer"

    training: Annotated[KeypointDeformerTraining, arg(name="")] = field(default_factory=KeypointDeformerTraining)

    def model(self) -> Any:
        """See above."""
        from kpred.peers.networks.keypoint_deformer import KeypointDeformerConfig

        return KeypointDeformerConfig(keypoints=self.training.spread_samples // 2)


@dataclass(frozen=True, kw_only=True)
class NeuralCagesCommand(_PeerCommand):
    """Train Neural Cages (Yifan et al. 2020): the source's cage and its motion are predicted from both shapes.

    examples:
      kpred train peer neural-cages chair.npz -o runs/neural-cages/chair
      kpred train peer neural-cages chair.npz -o runs/short --optimisation.steps 1500 --optimisation.batch 8
    """

    peer: ClassVar[str] = "neural-cages"

    training: Annotated[NeuralCagesTraining, arg(name="")] = field(default_factory=NeuralCagesTraining)

    def model(self) -> Any:
        """See above."""
        from kpred.peers.networks.neural_cages import NeuralCagesConfig

        return NeuralCagesConfig()


@dataclass(frozen=True, kw_only=True)
class _PartsCommand(_PeerCommand):
    """What the commands of part-wise methods share."""

    parts: Annotated[int, arg(metavar="N")] = 24
    """Most parts of a source; of one that has more, the smallest are joined to their neighbours"""


@dataclass(frozen=True, kw_only=True)
class Uy2021Command(_PartsCommand):
    """Train Uy et al. 2021: part-wise deformation and retrieval together; sources are the split source.

    Parts are the labels of a generated pack, or what hangs together. The sources are known by learned codes, so that
    only these can be retrieved later: train on the packs that are measured.

    examples:
      kpred train peer uy2021 chair.npz -o runs/uy2021/chair
      kpred train peer uy2021 chair.npz -o runs/short --optimisation.steps 1500 --parts 16
    """

    peer: ClassVar[str] = "uy2021"

    training: Annotated[Uy2021Training, arg(name="")] = field(default_factory=Uy2021Training)

    def model(self) -> Any:
        """See above."""
        from kpred.peers.networks.uy2021 import Uy2021Config

        return Uy2021Config(parts=self.parts)


@dataclass(frozen=True, kw_only=True)
class URedCommand(_PartsCommand):
    """Train U-RED (Di et al. 2023): parts moved by attention, retrieval by the residual that would be left.

    Sources of the training are the split source; any others can be retrieved later too.

    examples:
      kpred train peer u-red chair.npz -o runs/u-red/chair
      kpred train peer u-red chair.npz -o runs/short --optimisation.steps 1500 --parts 16
    """

    peer: ClassVar[str] = "u-red"

    training: Annotated[URedTraining, arg(name="")] = field(default_factory=URedTraining)

    def model(self) -> Any:
        """See above."""
        from kpred.peers.networks.u_red import URedConfig

        return URedConfig(parts=self.parts)


@dataclass(frozen=True, kw_only=True)
class ShapeFlowCommand(_PeerCommand):
    """Train ShapeFlow (Jiang et al. 2020): shapes flow to a common hub and on to each other, by learned codes.

    The sources are known by learned codes, so that only these can be retrieved later: train on the packs that are
    measured.

    examples:
      kpred train peer shapeflow chair.npz -o runs/shapeflow/chair
      kpred train peer shapeflow chair.npz -o runs/short --optimisation.steps 1500
    """

    peer: ClassVar[str] = "shapeflow"

    training: Annotated[ShapeFlowTraining, arg(name="")] = field(default_factory=ShapeFlowTraining)

    def model(self) -> Any:
        """See above."""
        from kpred.peers.networks.shapeflow import ShapeFlowConfig

        return ShapeFlowConfig()


COMMANDS = (KeypointDeformerCommand, NeuralCagesCommand, Uy2021Command, URedCommand, ShapeFlowCommand)

PEER_COMMANDS = Group(
    {command.peer: command for command in COMMANDS},
    "Train another published method, to be measured by `kpred evaluate peers`.",
)
