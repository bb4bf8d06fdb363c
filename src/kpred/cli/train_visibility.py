"""`kpred train visibility`: the network that predicts where a scanner would have seen surface."""

from __future__ import annotations

import time
from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated

from tyro.conf import Positional, arg

from kpred.cli.command import Command
from kpred.cli.devices import limit_threads
from kpred.cli.output import Output
from kpred.cli.processes import joined_world, own_device
from kpred.cli.usage import UsageError
from kpred.training.visibility_config import VisibilityTraining


@dataclass(frozen=True, kw_only=True)
class VisibilityCommand(Command):
    """Train the network that predicts, for any place around a scan, whether surface there would have been seen.

    Its weights go to FOLDER/model; as the folder `visibility` beside the categories' folders of a model they are used.
    A run that was stopped goes on exactly where it was when the same command is given again.

    examples:
      kpred train visibility chair.npz table.npz cabinet.npz -o runs/visibility
      kpred train visibility packs/*.npz -o runs/visibility --optimisation.steps 20000 --precision bfloat16
    """

    packs: Annotated[Positional[tuple[Path, ...]], arg(metavar="PACK [PACK ...]", help_behavior_hint="")]
    """Mesh packs (.npz) of all categories; the splits source and train are used"""
    room_packs: Annotated[tuple[Path, ...], arg(metavar="ROOMS [ROOMS ...]")] = ()
    """Room packs (`kpred data rooms`): crops of them are half of what is trained with (--rooms says which fraction)"""
    start_from: Annotated[Path | None, arg(metavar="FOLDER")] = None
    """Start with the weights of this visibility network"""
    output: Annotated[Path, arg(aliases=["-o"], metavar="FOLDER")] = Path("runs/visibility")
    """Run folder: checkpoint, TensorBoard log, weights in FOLDER/model"""
    device: Annotated[str, arg(metavar="DEVICE")] = "auto"
    """auto (CUDA where there is one), cpu, cuda, cuda:1, ..."""
    threads: Annotated[int | None, arg(metavar="N")] = None
    """CPU threads; without it, as many as torch chooses"""
    resume: Annotated[bool, arg(help_behavior_hint="")] = True
    """Start anew in a folder that holds a stopped run, and not where it stopped"""
    training: Annotated[VisibilityTraining, arg(name="")] = field(default_factory=VisibilityTraining)

    def run(self, output: Output) -> None:
        """Train with a progress bar; print where the weights are."""
        from kpred.cli.progress import ProgressBar
        from kpred.shapes.pack import MeshPack
        from kpred.synthetic.rooms.pack import RoomPack
        from kpred.training.visibility import train_visibility

        if not self.packs:
            raise UsageError("no pack was named; try `kpred train visibility CHAIR.npz TABLE.npz -o FOLDER`")
        if self.threads is not None:
            limit_threads(self.threads)
        last: dict[str, float] = {}
        began = time.perf_counter()
        device = own_device(self.device)
        with joined_world(device) as world, ProgressBar() as bar:

            def report(stage: str, done: int, total: int, losses: dict[str, float]) -> None:
                last.update(losses)
                bar.update(stage, done, total, f"loss {sum(losses.values()):.3g}")

            packs = [MeshPack.load(path) for path in self.packs]
            train_visibility(
                packs,
                self.training,
                self.output,
                device,
                bar.update,
                report,
                self.resume,
                world=world,
                rooms=[RoomPack.load(path) for path in self.room_packs],
                start_from=self.start_from,
            )
        if not world.is_first:
            return
        seconds = time.perf_counter() - began
        weights = self.output / "model"
        output.result({"model": weights, "seconds": seconds, "last_losses": last})
        output.note(f"weights: {weights} ({seconds:.0f} s)")
