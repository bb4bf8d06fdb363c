"""`kpred train peer`: other published methods, on the same packs and in the same loop."""

from __future__ import annotations

import time
from abc import abstractmethod
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, ClassVar

from tyro.conf import Positional, arg

from kpred.cli.command import Command, Group
from kpred.cli.devices import found_device, limit_threads
from kpred.cli.output import Output
from kpred.cli.usage import UsageError
from kpred.training.peers.config import KeypointDeformerTraining, Uy2021Training

if TYPE_CHECKING:
    from kpred.shapes.pack import MeshPack

Progress = Callable[[str, int, int], None]


@dataclass(frozen=True, kw_only=True)
class _PeerCommand(Command):
    """What the peers' commands share."""

    peer: ClassVar[str]

    packs: Annotated[Positional[tuple[Path, ...]], arg(metavar="PACK [PACK ...]", help_behavior_hint="")]
    """Mesh packs (.npz) of one category; the splits source and train are used"""
    output: Annotated[Path | None, arg(aliases=["-o"], metavar="FOLDER")] = None
    """Run folder: checkpoint, TensorBoard log, weights in FOLDER/model; without it, runs/PEER/CATEGORY"""
    device: Annotated[str, arg(metavar="DEVICE")] = "auto"
    """auto (CUDA where there is one), cpu, cuda, cuda:1, ..."""
    threads: Annotated[int | None, arg(metavar="N")] = None
    """CPU threads; without it, as many as torch chooses"""
    resume: Annotated[bool, arg(help_behavior_hint="")] = True
    """Start anew in a folder that holds a stopped run, and not where it stopped"""

    def run(self, output: Output) -> None:
        """Train with a progress bar; print where the weights are."""
        from kpred.cli.processes import refuse
        from kpred.cli.progress import ProgressBar
        from kpred.shapes.pack import MeshPack

        refuse(f"`kpred train peer {self.peer}`")
        if not self.packs:
            raise UsageError(f"no pack was named; try `kpred train peer {self.peer} PACK.npz -o FOLDER`")
        packs = [MeshPack.load(path) for path in self.packs]
        if self.threads is not None:
            limit_threads(self.threads)
        folder = self.output if self.output is not None else Path("runs") / self.peer / packs[0].category
        last: dict[str, float] = {}
        began = time.perf_counter()
        try:
            with ProgressBar() as bar:

                def report(stage: str, done: int, total: int, losses: dict[str, float]) -> None:
                    last.update(losses)
                    bar.update(stage, done, total, f"loss {sum(losses.values()):.3g}")

                network = self._train(packs, folder, found_device(self.device), bar.update, report)
        except KeyboardInterrupt as error:
            if not any(folder.glob("*.checkpoint")):
                raise
            raise KeyboardInterrupt(f"{folder} keeps what was trained, and the same command goes on from it") from error
        seconds = time.perf_counter() - began
        weights = folder / "model"
        output.result(
            {
                "peer": self.peer,
                "model": weights,
                "category": network.config.category,
                "seconds": seconds,
                "last_losses": last,
            }
        )
        if last:
            output.table("last step", ["loss", "value"], list(last.items()))
        output.note(f"weights: {weights} ({seconds:.0f} s)")

    @abstractmethod
    def _train(
        self,
        packs: list[MeshPack],
        folder: Path,
        device: str,
        progress: Progress,
        report: Callable[[str, int, int, dict[str, float]], None],
    ) -> Any:
        """Train this peer."""


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

    def _train(self, packs: Any, folder: Path, device: str, progress: Any, report: Any) -> Any:
        from kpred.nn.peers.keypoint_deformer import KeypointDeformerConfig
        from kpred.training.peers.run import train_keypoint_deformer

        model = KeypointDeformerConfig(keypoints=self.training.spread_samples // 2)
        return train_keypoint_deformer(packs, model, self.training, folder, device, progress, report, self.resume)


@dataclass(frozen=True, kw_only=True)
class Uy2021Command(_PeerCommand):
    """Train Uy et al. 2021: part-wise deformation and retrieval together; sources are the split source.

    Parts are the labels of a generated pack, or what hangs together. The sources are known by learned codes, so that
    only these can be retrieved later: train on the packs that are measured.

    examples:
      kpred train peer uy2021 chair.npz -o runs/uy2021/chair
      kpred train peer uy2021 chair.npz -o runs/short --optimisation.steps 1500 --parts 16
    """

    peer: ClassVar[str] = "uy2021"

    parts: Annotated[int, arg(metavar="N")] = 24
    """Most parts of a source; of one that has more, the smallest are joined to their neighbours"""
    training: Annotated[Uy2021Training, arg(name="")] = field(default_factory=Uy2021Training)

    def _train(self, packs: Any, folder: Path, device: str, progress: Any, report: Any) -> Any:
        from kpred.nn.peers.uy2021 import Uy2021Config
        from kpred.training.peers.run import train_uy2021

        return train_uy2021(
            packs, Uy2021Config(parts=self.parts), self.training, folder, device, progress, report, self.resume
        )


PEER_COMMANDS = Group(
    {KeypointDeformerCommand.peer: KeypointDeformerCommand, Uy2021Command.peer: Uy2021Command},
    "Train another published method, to be measured by `kpred evaluate peers`.",
)
