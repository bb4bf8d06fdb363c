"""`kpred bench`: how fast, and how much faster than the plain way, on this machine."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import AbstractContextManager, nullcontext
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING, Annotated, Any

from tyro.conf import arg

from kpred.cli.command import Command
from kpred.cli.output import Output
from kpred.cli.usage import UsageError

if TYPE_CHECKING:
    from kpred.bench.figure import Figure
    from kpred.bench.searching import Point
    from kpred.cli.progress import ProgressBar

PARTS = ("start", "fit", "search", "build", "training")


@dataclass(frozen=True, kw_only=True)
class BenchCommand(Command):
    """Measure speed and memory on this machine, every figure beside the plain way of doing the same.

    Searching a million models needs 5 GB on the disk of the work folder. Other programs that run disturb the figures:
    the load is printed with each.

    examples:
      kpred bench
      kpred bench --only fit --threads 2 --json
      kpred bench --only search --sizes 1000 10000 100000 1000000 --plot scaling.png -o bench.json
    """

    output: Annotated[Path | None, arg(aliases=["-o"], metavar="FILE")] = None
    """Write the figures as JSON too"""
    plot: Annotated[Path | None, arg(metavar="FILE")] = None
    """Draw search and making of the token file against the number of models: .png or .pdf"""
    only: Annotated[tuple[str, ...], arg(metavar="PART [PART ...]")] = PARTS
    """Measure these parts only: start, fit, search, build, training"""
    sizes: Annotated[tuple[int, ...], arg(metavar="N [N ...]")] = (1_000, 10_000, 100_000, 1_000_000)
    """Numbers of models that are searched"""
    models: Annotated[int, arg(metavar="N")] = 1000
    """Models of the database that is fitted from"""
    scans: Annotated[int, arg(metavar="N")] = 30
    """Scans that are fitted"""
    threads: Annotated[int, arg(metavar="N")] = 2
    """CPU threads, of torch and of the compiled kernels"""
    work: Annotated[Path | None, arg(metavar="DIR")] = None
    """Keep the database of generated models here for the next time; without it, all is made in a temporary folder"""

    def run(self, output: Output) -> None:
        """Measure, print, write."""

        from kpred.atomic import check_place
        from kpred.bench.figure import load, machine
        from kpred.cli.devices import limit_threads
        from kpred.cli.progress import ProgressBar
        from kpred.json_output import write_json

        self._check()
        for file in (self.output, self.plot):
            if file is not None:
                check_place(file)
        limit_threads(self.threads)
        facts = machine(self.threads)
        curve: list[Point] = []
        figures: list[Figure] = []
        place: AbstractContextManager[str | Path] = TemporaryDirectory(prefix="kpred-bench-")
        if self.work is not None:
            self.work.mkdir(parents=True, exist_ok=True)
            place = nullcontext(self.work)
        with place as folder, ProgressBar() as bar:
            for figure in self._figures(Path(folder), curve, bar):
                figures.append(figure)
                bar.update("measuring", len(figures))
        facts["load_after"] = load()
        record = {"machine": facts, "figures": [f.to_json() for f in figures], "scaling": [p.__dict__ for p in curve]}
        if self.output is not None:
            write_json(self.output, record)
        if self.plot is not None and curve:
            from kpred.bench.plot import save_scaling_plot

            save_scaling_plot(curve, self.plot)
        output.result(record)
        title = f"{facts['processor']}, {facts['cores']} cores, {self.threads} threads, load {facts['load_before']:.1f}"
        columns = ["figure", "median", "best", "unit", "limit", "", "load", "baseline", "its median", "gain"]
        output.table(title, columns, [_row(figure) for figure in figures])
        for file in (self.output, self.plot if curve else None):
            if file is not None:
                output.note(f"wrote {file}")

    def _check(self) -> None:
        for part in self.only:
            if part not in PARTS:
                raise UsageError(f"there is no part {part!r} to measure; choose of {', '.join(PARTS)}.")
        if min((*self.sizes, self.models, self.scans, self.threads)) < 1:
            raise UsageError("--sizes, --models, --scans and --threads must be at least 1.")
        if self.plot is not None and self.plot.suffix.lower() not in (".png", ".pdf"):
            raise UsageError(f"{self.plot}: the plot is a .png or .pdf file; give it one of these extensions.")

    def _figures(self, folder: Path, curve: list[Point], bar: ProgressBar) -> Iterator[Figure]:
        from kpred.bench import building, fits, searching
        from kpred.database import Database
        from kpred.fitting import bundled_database_path
        from kpred.nn import load_model

        def report(task: str) -> Any:
            return lambda done, total: bar.update(task, done, total)

        if "start" in self.only:
            yield from building.start_figures()
        model = load_model(None) if {"fit", "build"} & set(self.only) else None
        if model is not None and "fit" in self.only:
            file = fits.models_database(folder / f"{self.models}.kpred", model, self.models, report("building"))
            yield from fits.fit_figures(model, file, self.scans, report("fitting"))
        if "search" in self.only:
            with Database.open(bundled_database_path(), read_only=True) as database:
                sizes = list(self.sizes)
                yield from searching.search_figures(database, folder, sizes, curve, report("making tables"))
        if model is not None and "build" in self.only:
            yield building.build_figure(model, folder)
        if "training" in self.only:
            yield building.training_figure()


def _row(figure: Figure) -> tuple[Any, ...]:
    kept = {None: "", True: "met", False: "MISSED"}[figure.met]
    gain = None if figure.gain is None else round(figure.gain, 1)
    values = (figure.name, figure.value, figure.best, figure.unit, figure.limit, kept, round(figure.load, 1))
    return (*values, figure.baseline, figure.baseline_value, gain)


COMMAND: type[Command] = BenchCommand
