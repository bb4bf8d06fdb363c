"""`kpred evaluate table ablation`: trains what is missing of the paper's ablations, measures it, prints the table."""

from __future__ import annotations

import time
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

from tyro.conf import arg

from kpred.cli.evaluate_cleanliness import print_cleanliness_of
from kpred.cli.output import Output
from kpred.cli.table_options import NOTE, SHORT, PackTableCommand, errors_of, label, print_pivot, shown
from kpred.cli.usage import UsageError

if TYPE_CHECKING:
    from kpred.evaluation.tables.table import Series, Table
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
    rows: Annotated[tuple[str, ...], arg(metavar="ROW [ROW ...]")] = (
        "a",
        "b",
        "c",
        "d",
        "e",
        "f",
        "with-cb",
        "without-cb",
    )
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
    """Shares hidden where CB is measured"""
    device: Annotated[str, arg(metavar="DEVICE")] = "auto"
    """Trains on: auto (CUDA where there is one), cpu, cuda, cuda:1, ..."""
    precision: Literal["float32", "bfloat16"] = "float32"
    """Of the training"""
    threads: Annotated[int | None, arg(metavar="N")] = None
    """CPU threads; without it, as many as torch chooses"""

    def run(self, output: Output) -> None:
        """Train and measure with a progress bar, print and write."""
        from kpred.cli.devices import found_device, limit_threads
        from kpred.cli.progress import ProgressBar
        from kpred.evaluation.tables.ablation_table import make_ablation_table
        from kpred.evaluation.tables.make_table import TableConfig
        from kpred.evaluation.tables.measuring import SourcePack
        from kpred.nn.config import preset
        from kpred.training.ablations import AblationRuns, recorded_training, rows_named

        self.check()
        self._check_settings()
        rows = rows_named(self.rows)
        training, device = self._training(), found_device(self.device)
        trained: dict[str, dict[str, Any]] = {}
        if self.threads is not None:
            limit_threads(self.threads)
        config = TableConfig("full", self.split, self.limit, self.seed, (self.top_k,), self.occlusions)
        began = time.perf_counter()
        try:
            with ProgressBar() as bar:

                def report(stage: str, done: int, total: int, losses: dict[str, float]) -> None:
                    bar.update(stage, done, total, f"loss {sum(losses.values()):.3g}")

                def runs(source: SourcePack, folder: Path, data_hash: str) -> AblationRuns:
                    model = preset(self.preset, source.pack.category)
                    own, split = training, self.source_split
                    if self.as_trained:
                        own, split = recorded_training(folder, rows)
                    trained[f"{source.dataset}/{source.pack.category}"] = own.to_dict()
                    return AblationRuns(
                        [source.pack],
                        model,
                        own,
                        folder,
                        data_hash,
                        device,
                        split,
                        bar.update,
                        report,
                    )

                table = make_ablation_table(
                    self.packs, rows, self.runs, runs, config, only_finished=self.finished, progress=bar.update
                )
        except KeyboardInterrupt as error:
            raise KeyboardInterrupt(
                f"{self.runs} keeps what was trained and measured; the same command goes on from it, and with "
                "--finished prints what there is"
            ) from error
        first, *others = trained.values()
        table.header["training"] = trained if any(other != first for other in others) else first
        self.finish(output, table, time.perf_counter() - began, self.show)

    def show(self, output: Output, table: Table) -> None:
        """Return the paper's table, its figure, and what each part does."""
        for dataset in table.datasets():
            _print_full(output, table, dataset, self.top_k)
            partial = [one for one in errors_of(table, dataset) if one.protocol == "partial"]
            for category in table.categories(dataset) if partial else ():
                print_pivot(
                    output,
                    table,
                    dataset,
                    f"{dataset}, {category}, partial shapes: best of {self.top_k}, {table.header['unit']}",
                    ["distance", "CB", "method"],
                    sorted(partial, key=lambda one: one.distance),
                    lambda one: (SHORT[one.distance], "yes" if one.model == "with-cb" else "no", label(one)),
                    lambda one: f"{one.occlusion:.0%} hidden",
                    category,
                )
            print_cleanliness_of(output, table, dataset, table.categories(dataset)[-1:])
        _print_effects(output, table)
        output.note(NOTE)

    def _check_settings(self) -> None:
        given = (self.steps, self.deformation_steps, self.retrieval_steps, self.partial_steps)
        if self.as_trained and any(steps is not None for steps in given):
            raise UsageError("--as-trained takes the steps from the rows in --runs; leave out --steps and its kin.")

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


def _print_full(output: Output, table: Table, dataset: str, top_k: int) -> None:
    from kpred.training.ablations import ROWS

    series = [one for one in errors_of(table, dataset) if one.protocol == "full"]
    if not series:
        return
    categories = table.categories(dataset)

    def marks(one: Series) -> list[str]:
        row = ROWS[one.model]
        return ["yes" if part else "no" for part in (row.gsa, row.dar, row.lgf)]

    output.table(
        f"{dataset}, whole shapes: CD, best of {top_k}, {table.header['unit']}",
        ["row", "GSA", "DAR", "LGF", "method", *categories],
        [
            [one.model, *marks(one), label(one), *(shown(table.cell(one, dataset, name)) for name in categories)]
            for one in sorted(series, key=lambda one: one.method)
        ],
    )


def _print_effects(output: Output, table: Table) -> None:
    from kpred.evaluation.tables.ablation_table import effects

    found = effects(table)
    if not found:
        return
    output.table(
        "what each part does: error with it / without it, 95 % paired bootstrap; Wilcoxon signed-rank test",
        ["data", "part", "rows", "method", "distance", "hidden", "n", "ratio", "p"],
        [
            [
                one.comparison.dataset,
                one.part,
                f"{one.without} -> {one.having}",
                label(one.comparison.series),
                SHORT[one.comparison.series.distance],
                f"{one.comparison.series.occlusion:.0%}" if one.comparison.series.protocol == "partial" else "",
                one.comparison.n,
                _ratio(one.comparison.ratio, one.comparison.low, one.comparison.high),
                one.comparison.p_value,
            ]
            for one in found
        ],
    )


def _ratio(value: float, low: float | None, high: float | None) -> str:
    return f"{value:.3f}" if low is None or high is None else f"{value:.3f} ({low:.3f}–{high:.3f})"
