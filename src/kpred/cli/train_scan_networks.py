"""`kpred train recognition` and `visibility`: the networks that read scans of all categories."""

from __future__ import annotations

import time
from abc import abstractmethod
from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated, Any, ClassVar

from tyro.conf import Positional, arg

from kpred.cli.output import Output
from kpred.cli.processes import joined_world, own_device
from kpred.cli.train_options import TrainingCommand, loss_note
from kpred.cli.usage import UsageError
from kpred.training.recognition_config import RecognitionConfig
from kpred.training.single_stage import SingleStageConfig
from kpred.training.visibility_config import VisibilityTraining


@dataclass(frozen=True, kw_only=True)
class _ScanNetworkCommand(TrainingCommand):
    """What both commands share."""

    network: ClassVar[str]

    packs: Annotated[Positional[tuple[Path, ...]], arg(metavar="PACK [PACK ...]", help_behavior_hint="")]
    """Mesh packs (.npz) of all categories, for recognition of other things too; the splits source and train are used"""
    room_packs: Annotated[tuple[Path, ...], arg(metavar="ROOMS [ROOMS ...]")] = ()
    """Room packs (`kpred data rooms`): crops of them are half of what is trained with (--rooms says which fraction)"""
    output: Annotated[Path | None, arg(aliases=["-o"], metavar="FOLDER")] = None
    """Run folder: checkpoint, TensorBoard log, weights in FOLDER/model; without it, below runs"""
    start_from: Annotated[Path | None, arg(metavar="FOLDER")] = None
    """Start with the weights of such a network in this folder"""
    training: Annotated[SingleStageConfig, arg(name="")] = field(default_factory=SingleStageConfig)

    @abstractmethod
    def train(self, *arguments: Any, **options: Any) -> Any:
        """Train the network, as `train_recognizer` and `train_visibility` do."""

    def facts(self, network: Any) -> dict[str, Any]:
        """Return what is printed of the network beside the place of its weights."""
        return {}

    def run(self, output: Output) -> None:
        """Train with a progress bar; print where the weights are."""
        from kpred.cli.progress import ProgressBar
        from kpred.shapes.pack import MeshPack
        from kpred.synthetic.rooms.pack import RoomPack

        if not self.packs:
            raise UsageError(f"no pack was named; try `kpred train {self.network} CHAIR.npz TABLE.npz -o FOLDER`")
        self.limit_threads()
        folder = self.output or Path("runs") / ("recognizer" if self.network == "recognition" else self.network)
        last: dict[str, float] = {}
        began = time.perf_counter()
        device = own_device(self.device)
        with joined_world(device) as world, ProgressBar() as bar:

            def report(stage: str, done: int, total: int, losses: dict[str, float]) -> None:
                last.update(losses)
                bar.update(stage, done, total, loss_note(losses))

            network = self.train(
                [MeshPack.load(path) for path in self.packs],
                self.training,
                folder,
                device,
                bar.update,
                report,
                self.resume,
                start_from=self.start_from,
                world=world,
                rooms=[RoomPack.load(path) for path in self.room_packs],
            )
        if not world.is_first:
            return
        seconds, facts = time.perf_counter() - began, self.facts(network)
        weights = folder / "model"
        output.result({"model": weights, **facts, "seconds": seconds, "last_losses": last})
        summary = "".join(f"{', '.join(value)}; " for value in facts.values())
        output.note(f"weights: {weights} ({summary}{seconds:.0f} s)")


@dataclass(frozen=True, kw_only=True)
class RecognitionCommand(_ScanNetworkCommand):
    """Train the recognizer, which predicts category and yaw of a scan, on packs of all categories of a model.

    Its weights go to FOLDER/model; as the folder `recognizer` beside the categories' folders of a model they are used,
    or as `recognizer_any` for databases of categories that `recognizer` does not know. A pack of the category `other`
    (`kpred data generate other`) shows what is none of them. With --start-from, categories can be added and left out.

    examples:
      kpred train recognition chair.npz table.npz other.npz -o runs/recognizer
      kpred train recognition packs/*.npz -o runs/recognizer --optimisation.steps 10000
      kpred train recognition packs/*.npz --room-packs rooms.npz -o runs/recognizer
    """

    network: ClassVar[str] = "recognition"

    training: Annotated[RecognitionConfig, arg(name="")] = field(default_factory=RecognitionConfig)

    def train(self, *arguments: Any, **options: Any) -> Any:
        """See above."""
        from kpred.training.recognition import train_recognizer

        return train_recognizer(*arguments, **options)

    def facts(self, network: Any) -> dict[str, Any]:
        """See above."""
        return {"categories": network.config.categories}


@dataclass(frozen=True, kw_only=True)
class VisibilityCommand(_ScanNetworkCommand):
    """Train the network that predicts, for any place around a scan, whether surface there would have been seen.

    Its weights go to FOLDER/model; as the folder `visibility` beside the categories' folders of a model they are used.
    A run that was stopped goes on exactly where it was when the same command is given again.

    examples:
      kpred train visibility chair.npz table.npz cabinet.npz -o runs/visibility
      kpred train visibility packs/*.npz -o runs/visibility --optimisation.steps 20000 --precision bfloat16
    """

    network: ClassVar[str] = "visibility"

    training: Annotated[VisibilityTraining, arg(name="")] = field(default_factory=VisibilityTraining)

    def train(self, *arguments: Any, **options: Any) -> Any:
        """See above."""
        from kpred.training.visibility import train_visibility

        return train_visibility(*arguments, **options)
