"""`kpred evaluate table ablation`: trains what is missing of the paper's ablations, measures it, prints the table."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

from tyro.conf import arg

from kpred.cli.stopping import resumable
from kpred.cli.table_options import PackTableCommand
from kpred.cli.train_options import loss_note
from kpred.cli.usage import UsageError

if TYPE_CHECKING:
    from kpred.cli.progress import ProgressBar
    from kpred.evaluation.tables.packs import SourcePack
    from kpred.evaluation.tables.table import Table
    from kpred.training.ablations import AblationRuns
    from kpred.training.config import TrainConfig


@dataclass(frozen=True, kw_only=True)
class AblationCommand(PackTableCommand):
    """Ablations: train the rows that are missing, measure them, print the table.

    Rows a to f switch geometric self-attention (GSA), deformation-aware retrieval (DAR) and local-global features
    (LGF), measured on whole shapes; with-cb and without-cb switch the confidence (CB), measured on partial shapes.
    Give one pack of each category. What was trained and measured is kept in --runs: a command that was stopped goes on
    when it is given again.

    examples:
      kpred evaluate table ablation chair.npz table.npz cabinet.npz --runs runs/ablation --steps 3000 -o ablation.json
      kpred evaluate table ablation chair.npz --runs runs/ablation --steps 3000 --rows e f --preset kp-red
      kpred evaluate table ablation chair.npz --runs runs/ablation --steps 3000 --finished
      kpred evaluate table ablation chair.npz --runs runs/ablation --as-trained
    """

    runs: Annotated[Path, arg(metavar="FOLDER")] = Path("runs/ablation")
    """Folder of all runs, FOLDER/<data set>/<category>/<row>"""
    rows: Annotated[tuple[str, ...], arg(metavar="ROW [ROW ...]")] = (*"abcdef", "with-cb", "without-cb")
    """Which rows"""
    steps: Annotated[int | None, arg(metavar="N")] = None
    """Steps of each training stage; without it, those of the preset"""
    deformation_steps: Annotated[int | None, arg(metavar="N")] = None
    """Steps of the first stage, where they differ"""
    retrieval_steps: Annotated[int | None, arg(metavar="N")] = None
    """Steps of the second stage, where they differ"""
    partial_steps: Annotated[int | None, arg(metavar="N")] = None
    """Steps of the third stage, where they differ"""
    preset: Literal["kp-red-plus", "kp-red"] = "kp-red"
    """Settings that all rows share: those of the paper, or this project's"""
    training_seed: Annotated[int, arg(metavar="SEED")] = 0
    """Of the training"""
    source_split: Annotated[str | None, arg(metavar="NAME")] = None
    """In training, deform shapes of this split only (the paper: source)"""
    as_trained: Annotated[bool, arg(help_behavior_hint="")] = False
    """Take the training's settings, steps included, from the rows in --runs; refused where rows differ in them"""
    finished: Annotated[bool, arg(help_behavior_hint="")] = False
    """Train nothing: only rows that are trained to the end"""
    top_k: Annotated[int, arg(metavar="K")] = 10
    """How many retrieved models are deformed and compared"""
    occlusions: Annotated[tuple[float, ...], arg(metavar="FRACTION [FRACTION ...]")] = (0.0, 0.25, 0.5, 0.75)
    """Fractions hidden where CB is measured"""
    device: Annotated[str, arg(metavar="DEVICE")] = "auto"
    """Trains on: auto (CUDA where there is one), cpu, cuda, cuda:1, ..."""
    precision: Literal["float32", "bfloat16"] = "float32"
    """Of the training"""
    threads: Annotated[int | None, arg(metavar="N")] = None
    """CPU threads; without it, as many as torch chooses"""

    def check(self) -> None:
        """Refuse what cannot work before any work is done."""
        super().check()
        given = (self.steps, self.deformation_steps, self.retrieval_steps, self.partial_steps)
        if self.as_trained and any(steps is not None for steps in given):
            raise UsageError("--as-trained takes the steps from the rows in --runs; leave out --steps and its kin.")

    def measure(self, bar: ProgressBar) -> Table:
        """Train and measure what is missing."""
        from kpred.cli.devices import found_device, limit_threads
        from kpred.evaluation.tables.ablation_table import make_ablation_table
        from kpred.evaluation.tables.config import TableConfig
        from kpred.training.ablations import recorded_training, rows_named

        rows, device = rows_named(self.rows), found_device(self.device)
        trained: dict[str, dict[str, Any]] = {}
        if self.threads is not None:
            limit_threads(self.threads)
        config = TableConfig("full", self.split, self.limit, self.seed, (self.top_k,), self.occlusions)

        def runs(source: SourcePack, folder: Path, data_hash: str) -> AblationRuns:
            own, split = recorded_training(folder, rows) if self.as_trained else (self._training(), self.source_split)
            trained[source.name] = own.to_dict()
            return self._runs(source, own, folder, data_hash, device, split, bar)

        kept = f"{self.runs} keeps what was trained and measured; the same command goes on from it"
        with resumable(f"{kept}, and with --finished prints what there is"):
            table = make_ablation_table(
                self.packs, rows, self.runs, runs, config, only_finished=self.finished, progress=bar.update
            )
        first, *others = trained.values()
        table.header["training"] = trained if any(other != first for other in others) else first
        return table

    def _runs(
        self,
        source: SourcePack,
        training: TrainConfig,
        folder: Path,
        data_hash: str,
        device: str,
        split: str | None,
        bar: ProgressBar,
    ) -> AblationRuns:
        from kpred.nn.config import preset
        from kpred.training.ablations import AblationRuns

        def report(stage: str, done: int, total: int, losses: dict[str, float]) -> None:
            bar.update(stage, done, total, loss_note(losses))

        model = preset(self.preset, source.pack.category)
        return AblationRuns([source.pack], model, training, folder, data_hash, device, split, bar.update, report)

    def _training(self) -> TrainConfig:
        from kpred.training.config import PAPER, TrainConfig

        start = PAPER if self.preset == "kp-red" else TrainConfig()
        stages = {}
        for name, own in (
            ("deformation", self.deformation_steps),
            ("retrieval", self.retrieval_steps),
            ("partial", self.partial_steps),
        ):
            steps = own if own is not None else self.steps
            stage = getattr(start, name)
            stages[name] = stage if steps is None else replace(stage, steps=steps)
        return replace(start, seed=self.training_seed, precision=self.precision, **stages)
