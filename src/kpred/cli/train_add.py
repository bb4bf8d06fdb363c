"""`kpred train add`: networks of a category of one's own, on top of the shared ones."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from tyro.conf import Positional, arg

from kpred.cli.output import Output
from kpred.cli.processes import own_device
from kpred.cli.train_options import TrainingCommand, loss_note, resumable_training
from kpred.cli.usage import UsageError
from kpred.training.config import StageConfig, TrainConfig

if TYPE_CHECKING:
    from kpred.cli.progress import ProgressBar
    from kpred.evaluation.tables.table import Table
    from kpred.shapes.pack import MeshPack

ADDED, SHARED_ALONE = "added", "shared"
"""Names, in the printed comparison, of the new networks and of the shared ones that they started from."""

SHORT = TrainConfig(
    deformation=StageConfig(steps=300, batch=12, learning_rate=5e-4),
    retrieval=StageConfig(steps=150, batch=24, learning_rate=5e-4),
    partial=StageConfig(steps=250, batch=12, learning_rate=5e-4),
    points=512,
    keypoint_points=512,
    warmup=0,
    late_step=0,
    checkpoint_every=50,
)
"""A short training that starts from networks that know much already: their keypoints need no warm-up."""


@dataclass(frozen=True, kw_only=True)
class AddCommand(TrainingCommand):
    """Add networks of a category of your own to a model: a short training on top of the shared ones.

    A fifth of the shapes is held out, unless the packs have a split `val`. At the end their error with the new networks
    stands beside that with the shared ones. FOLDER/model is a whole model: all that the other one knows, unchanged, and
    the new category; `--model FOLDER/model` names it. It is found by `--category`, as no recognizer knows it.

    examples:
      kpred train add mower mower.npz -o runs/mower
      kpred database build mower.npz --model runs/mower/model -o mower.kpred
      kpred fit scan.ply --model runs/mower/model --database mower.kpred --category mower -o out.obj
    """

    category: Annotated[Positional[str], arg(metavar="CATEGORY")]
    """Name of the new category"""
    packs: Annotated[Positional[tuple[Path, ...]], arg(metavar="PACK [PACK ...]", help_behavior_hint="")]
    """Its shapes: mesh packs (.npz), whatever category they name, or folders or manifests of meshes, as `kpred database
    build` takes them"""
    output: Annotated[Path | None, arg(aliases=["-o"], metavar="FOLDER")] = None
    """Run folder, as of `kpred train all`; without it, runs/CATEGORY"""
    base: Annotated[str | None, arg(metavar="NAME_OR_PATH")] = None
    """Model that is added to; without it, the bundled one"""
    limit: Annotated[int, arg(metavar="N")] = 40
    """At most so many shapes that are held out are measured"""
    training: Annotated[TrainConfig, arg(name="")] = field(default_factory=lambda: SHORT)

    def run(self, output: Output) -> None:
        """Split, train with a progress bar, write the whole model, measure what was held out, and print."""
        from kpred.cli.progress import ProgressBar
        from kpred.cli.table_options import print_pages
        from kpred.evaluation.tables.pages import ratio_pages
        from kpred.nn.loading import find_model, load_model
        from kpred.training.adding import advice, check_name, complete_model, own_splits

        if not self.packs:
            raise UsageError("no pack was named; try `kpred train add CATEGORY PACK.npz -o FOLDER`")
        self.limit_threads()
        base = load_model(self.base)
        check_name(self.category, base)
        left_out = list[str]()
        pack = own_splits(self._loaded(left_out.append), self.training.seed)
        sentences = [*left_out, *advice(pack)]
        for sentence in sentences:
            output.note(f"note: {sentence}")
        folder = self.output if self.output is not None else Path("runs") / self.category
        began, losses = time.perf_counter(), dict[str, dict[str, float]]()
        with resumable_training(folder), ProgressBar() as bar:
            self._train(pack, folder, bar, losses)
            complete_model(folder / "model", self.category, find_model(self.base))
            seconds = time.perf_counter() - began
            table = self._measured(pack, folder, bar)
        held_out = [
            {"model": cell.series.model, "method": cell.series.method, "value": cell.value, "n": cell.n}
            for cell in table.cells()
            if cell.series.is_error and cell.category == self.category
        ]
        facts = {"model": folder / "model", "category": self.category, "seconds": seconds, "held_out": held_out}
        output.result(facts | {"last_losses": losses, "notes": sentences})
        print_pages(output, list(ratio_pages(table))[:1])
        output.note(f"model: {folder / 'model'} ({seconds:.0f} s)")

    def _loaded(self, report: Callable[[str], None]) -> MeshPack:
        from kpred.shapes.pack import MeshPack, concatenate
        from kpred.shapes.source import open_shapes

        packs = []
        for path in self.packs:
            if path.is_dir() or path.suffix.lower() != ".npz":
                shapes = list(open_shapes(path, self.category, report=report))
                columns = (
                    [one.mesh for one in shapes],
                    [one.model_id for one in shapes],
                    [one.split for one in shapes],
                )
                packs.append(MeshPack.from_meshes(*columns, self.category))
            else:
                packs.append(MeshPack.load(path))
        return concatenate(packs, self.category)

    def _train(self, pack: MeshPack, folder: Path, bar: ProgressBar, last: dict[str, dict[str, float]]) -> None:
        from kpred.training.adding import shared_part
        from kpred.training.run import train

        def report(stage: str, done: int, total: int, losses: dict[str, float]) -> None:
            last[stage] = losses
            bar.update(stage, done, total, loss_note(losses))

        start, config = shared_part(self.base, self.category)
        train(
            [pack],
            config,
            self.training,
            folder,
            device=own_device(self.device),
            progress=bar.update,
            report=report,
            resume=self.resume,
            start_from=start,
        )

    def _measured(self, pack: MeshPack, folder: Path, bar: ProgressBar) -> Table:
        """Measure the shapes that were held out, with the new networks and with the shared ones."""
        from kpred.evaluation.tables.config import TableConfig
        from kpred.evaluation.tables.make_table import make_table
        from kpred.training.adding import shared_part

        file = folder / "shapes" / f"{self.category}.npz"
        file.parent.mkdir(exist_ok=True)
        pack.save(file)
        shared, _ = shared_part(self.base, self.category)
        models = {ADDED: folder / "model", SHARED_ALONE: shared}
        return make_table([file], models, TableConfig(limit=self.limit), progress=bar.update, report=lambda _: None)
