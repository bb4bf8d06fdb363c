"""`kpred train`: the three stages of one category's networks."""

from __future__ import annotations

import dataclasses
import time
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, ClassVar, Literal

from tyro.conf import Positional, arg

from kpred.cli.command import Command, Group
from kpred.cli.output import Output
from kpred.cli.processes import joined_world, own_device
from kpred.cli.train_add import AddCommand
from kpred.cli.train_confidence import ConfidenceCommand
from kpred.cli.train_options import TrainingCommand, loss_note, resumable_training
from kpred.cli.train_peer import PEER_COMMANDS
from kpred.cli.train_scan_networks import RecognitionCommand, VisibilityCommand
from kpred.cli.usage import UsageError
from kpred.nn.config import PRESETS, SHARED, ModelConfig
from kpred.training.config import PAPER, TrainConfig

if TYPE_CHECKING:
    from kpred.training.distributed import World

STAGES = ("deformation", "retrieval", "partial")


@dataclass(frozen=True, kw_only=True)
class _TrainCommand(TrainingCommand):
    """What the commands of all stages share."""

    stages: ClassVar[tuple[str, ...]] = STAGES

    packs: Annotated[Positional[tuple[Path, ...]], arg(metavar="PACK [PACK ...]", help_behavior_hint="")]
    """Mesh packs (.npz) of one category, or of several with --shared; the splits source and train are used"""
    shared: Annotated[bool, arg(help_behavior_hint="")] = False
    """Train one network for all categories of the packs, and any other: its weights go into MODEL/any"""
    output: Annotated[Path | None, arg(aliases=["-o"], metavar="FOLDER")] = None
    """Run folder: checkpoints, TensorBoard log, weights in FOLDER/model; without it, runs/CATEGORY"""
    preset: Literal["kp-red-plus", "kp-red"] = "kp-red-plus"
    """Where the settings start: this project's, or those of the paper; options below change single ones"""
    source_split: Annotated[str | None, arg(metavar="NAME")] = None
    """Deform shapes of this split only (the paper: source)"""
    start_from: Annotated[str | None, arg(metavar="NAME_OR_PATH")] = None
    """Take what the stages build on from these weights (`bundled`, a folder), and not from the run folder"""
    model: ModelConfig = field(default_factory=lambda: ModelConfig(category=""))
    training: Annotated[TrainConfig, arg(name="")] = field(default_factory=TrainConfig)

    def run(self, output: Output) -> None:
        """Train with a progress bar; print where the weights are."""
        if not self.packs:
            raise UsageError(f"no pack was named; try `kpred train {self.stages[0]} PACK.npz -o FOLDER`")
        self.limit_threads()
        device = own_device(self.device)
        with joined_world(device) as world:
            self._train(output, world, device)

    def _train(self, output: Output, world: World, device: str) -> None:
        from kpred.cli.progress import ProgressBar
        from kpred.errors import ConfigError
        from kpred.shapes.pack import MeshPack
        from kpred.training.adding import SENSIBLE
        from kpred.training.run import train

        packs = [MeshPack.load(path) for path in self.packs]
        found = sorted({pack.category for pack in packs} | ({self.model.category} - {""}))
        categories = [SHARED] if self.shared else found
        if len(categories) > 1:
            raise ConfigError(
                f"A run trains one category, but was given {', '.join(categories)}; give packs of one, or --shared."
            )
        few = sum(len(pack.indices("source")) + len(pack.indices("train")) for pack in packs)
        if few < SENSIBLE and world.is_first:
            output.caution(
                f"{few} shapes are few to train on ({SENSIBLE} or more are sensible); `kpred train add` builds "
                "on the shared networks, and compares with them."
            )
        folder = self.output if self.output is not None else Path("runs") / categories[0]
        began = time.perf_counter()
        last: dict[str, dict[str, float]] = {}
        with resumable_training(folder), ProgressBar() as bar:

            def report(stage: str, done: int, total: int, losses: dict[str, float]) -> None:
                last[stage] = losses
                bar.update(stage, done, total, loss_note(losses))

            train(
                packs,
                dataclasses.replace(self.model, category=categories[0]),
                self.training,
                folder,
                stages=self.stages,
                device=device,
                source_split=self.source_split,
                progress=bar.update,
                report=report,
                resume=self.resume,
                start_from=self.start_from,
                world=world,
            )
        if not world.is_first:
            return
        seconds = time.perf_counter() - began
        weights = folder / "model"
        facts = {"model": weights, "category": categories[0], "seconds": seconds, "last_losses": last}
        output.result(facts | ({"processes": world.size} if not world.is_single else {}))
        rows = [(stage, name, value) for stage, losses in last.items() for name, value in losses.items()]
        if rows:
            output.table("last step", ["stage", "loss", "value"], rows)
        output.note(f"weights: {weights} ({seconds:.0f} s)")


@dataclass(frozen=True, kw_only=True)
class DeformationCommand(_TrainCommand):
    """Train keypoints and influence: the first stage.

    A run that was stopped (Ctrl-C, a killed machine) goes on exactly where it was when the same command is given again.

    examples:
      kpred train deformation chair.npz -o runs/chair
      kpred train deformation chair.npz -o runs/paper --preset kp-red --deformation.steps 100000
    """

    stages: ClassVar[tuple[str, ...]] = ("deformation",)


@dataclass(frozen=True, kw_only=True)
class RetrievalCommand(_TrainCommand):
    """Train retrieval tokens in a run folder where deformation was trained: the second stage.

    examples:
      kpred train retrieval chair.npz -o runs/chair
      kpred train retrieval chair.npz -o runs/chair --retrieval.learning-rate 0.01
    """

    stages: ClassVar[tuple[str, ...]] = ("retrieval",)


@dataclass(frozen=True, kw_only=True)
class PartialCommand(_TrainCommand):
    """Train the networks for partial scans in a run folder where retrieval was trained: the third stage.

    examples:
      kpred train partial chair.npz -o runs/chair
      kpred train partial chair.npz -o runs/chair --occlusion 0.25 0.75
    """

    stages: ClassVar[tuple[str, ...]] = ("partial",)


@dataclass(frozen=True, kw_only=True)
class AllCommand(_TrainCommand):
    """Train the three stages one after the other.

    A run that was stopped (Ctrl-C, a killed machine) goes on exactly where it was when the same command is given again.
    Started by torchrun, each process (on CUDA: each GPU) draws its own batches, and a step takes their mean gradient.

    examples:
      kpred train all chair.npz -o runs/chair
      kpred train all chair.npz more_chairs.npz -o runs/chair --device cuda --precision bfloat16
      torchrun --nproc-per-node 4 -m kpred train all chair.npz -o runs/chair
      kpred train all chair.npz -o runs/without-attention --model.no-self-attention
      kpred train all chair.npz -o runs/short --deformation.steps 500 --retrieval.steps 500 --partial.steps 500
    """


def default(kind: type[Command], words: list[str]) -> Command:
    """Return the command with the settings of the preset in `words`, for single options to change."""
    settings: dict[str, Any] = {"packs": ()}
    if kind is AddCommand:
        settings["category"] = ""
    if issubclass(kind, _TrainCommand):
        named = [b for a, b in zip(words, words[1:], strict=False) if a == "--preset"]
        named += [word.partition("=")[2] for word in words if word.startswith("--preset=")]
        preset = named[-1] if named and named[-1] in PRESETS else "kp-red-plus"
        settings["preset"] = preset
        settings["model"] = ModelConfig(category="", **PRESETS[preset])
        settings["training"] = PAPER if preset == "kp-red" else TrainConfig()
    return kind(**settings)


COMMAND = Group(
    {
        "deformation": DeformationCommand,
        "retrieval": RetrievalCommand,
        "partial": PartialCommand,
        "all": AllCommand,
        "add": AddCommand,
        "recognition": RecognitionCommand,
        "visibility": VisibilityCommand,
        "confidence": ConfidenceCommand,
        "peer": PEER_COMMANDS,
    }
)
