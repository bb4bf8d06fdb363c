"""`kpred fit-many`: very many scans in, a folder of CAD meshes and records out."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, ClassVar, Literal

from tyro.conf import Positional, arg

from kpred.cli.command import Command, NetworkCommand
from kpred.cli.output import Output
from kpred.cli.stopping import resumable
from kpred.refinement.config import Deform
from kpred.shapes.unit_name import UnitName

if TYPE_CHECKING:
    from kpred.batch.run import BatchReport


@dataclass(frozen=True, kw_only=True)
class FitManyCommand(NetworkCommand):
    """Fit CAD models to all scans of a folder or of a Parquet manifest.

    A manifest has a column `path`, and may have `id` and `category`. Each scan gets a record (.json) and a mesh in OUT;
    OUT/results.jsonl and OUT/failures.jsonl list them. A run that was stopped or killed goes on where it was when the
    same command is given again; what failed is then tried again.

    examples:
      kpred fit-many scans/ -o fitted/
      kpred fit-many scans/ -o fitted/ --report fitted.html
      kpred fit-many scans.parquet -o fitted/ --category chair --workers 8
      kpred fit-many scans/ -o placed/ --deform scale --mesh .glb
      kpred fit-many s3_copy/scans.parquet -o /shared/fitted --ray auto --mesh .glb
    """

    fits: ClassVar[bool] = True

    source: Annotated[Positional[Path], arg(metavar="INPUT")]
    """Folder of scans, or Parquet manifest (.parquet)"""
    output: Annotated[Path | None, arg(aliases=["-o"], metavar="OUT")] = None
    """Folder for results, made when it does not exist; without it, INPUT_fitted in this folder"""
    category: Annotated[str | None, arg(metavar="NAME")] = None
    """Of scans whose manifest names none; without it, found for each"""
    database: Annotated[str | None, arg(metavar="FILE_OR_URL")] = None
    """CAD database: a file (.kpred) or postgresql://...; without it, the bundled one"""
    top_k: Annotated[int, arg(metavar="K")] = 10
    """How many retrieved models to deform and compare"""
    frame: Literal["auto", "known"] = "auto"
    """auto finds each scan's box and front; known takes scans as y up, front +z, in their unit box"""
    up: Literal["auto", "x", "y", "z", "-x", "-y", "-z"] = "auto"
    """Up axis of the scans"""
    deform: Deform = "auto"
    """How far a model may be changed (`kpred fit --help`); auto takes the least that explains a scan"""
    model_id: Annotated[str | None, arg(metavar="ID")] = None
    """Fit this model of the database to every scan"""
    clean: Annotated[bool, arg(help_behavior_hint="")] = True
    """Take the scans as they are"""
    mesh: Annotated[str, arg(metavar="EXTENSION")] = ".ply"
    """Kind of mesh files, any that kpred fit writes (.glb, .usdz, .xml, ...); none writes records alone"""
    unit: UnitName | Literal["auto"] = "auto"
    """Unit of the scans' lengths, for mesh files in metres; auto guesses it for each from its size"""
    report: Annotated[Path | None, arg(metavar="FILE")] = None
    """Write a page about the batch too (.html): what failed first, a sheet of pictures, a table to sort"""
    workers: Annotated[int | None, arg(metavar="N")] = None
    """Processes of one thread each; without it, one a core (on Ray, one a CPU of the cluster)"""
    ray: Annotated[str | None, arg(metavar="ADDRESS")] = None
    """Work on a Ray cluster: auto, local or its address; all machines must see scans and OUT under the same paths"""
    gpus_per_worker: Annotated[float, arg(metavar="FRACTION")] = 0.0
    """Fraction of a GPU that each worker on Ray takes (0.25: four share one); its networks then run there"""
    attempts: Annotated[int, arg(metavar="N")] = 3
    """How often a scan is tried whose failure may have been an accident (a dead worker, a full disk)"""
    time_limit: Annotated[float, arg(metavar="SECONDS")] = 600.0
    """Time after which one scan is given up"""

    def run(self, output: Output) -> None:
        """Fit all, print the numbers and what failed."""
        from kpred.batch.run import count_scans, fit_many
        from kpred.batch.worker import BatchSettings
        from kpred.cli.progress import ProgressBar
        from kpred.errors import ScanError
        from kpred.reports.page import check_report

        settings = BatchSettings(
            model=self.model,
            database=self.database,
            category=self.category,
            top_k=self.top_k,
            frame=self.frame,
            up=self.up,
            deform=self.deform,
            model_id=self.model_id,
            clean=self.clean,
            unit=self.unit,
            mesh="" if self.mesh == "none" else f".{self.mesh.lower().removeprefix('.')}",
            time_limit=self.time_limit,
        )
        if self.report is not None:
            check_report(self.report)
        target = self.output or Path(f"{self.source.resolve().stem}_fitted")
        total = count_scans(self.source) if self.source.exists() else None
        kept = f"what is in {target} is whole, and the same command goes on with it"
        with resumable(kept), ProgressBar() as bar:

            def show(report: BatchReport) -> None:
                note = f"{len(report.failed)} failed" if report.failed else ""
                bar.update("fitting scans", report.handled, total, note)

            report = fit_many(
                self.source,
                target,
                settings,
                workers=self.workers,
                ray=self.ray,
                attempts=self.attempts,
                gpus=self.gpus_per_worker,
                progress=show,
            )
        self._report(output, report, target)
        if self.report is not None:
            self._write_report(output, target, self.report)
        if report.failed and not report.fitted and not report.present:
            raise ScanError(f"{self.source}: none of its {len(report.failed)} scans could be fitted.")

    def _write_report(self, output: Output, folder: Path, file: Path) -> None:
        from kpred.cli.progress import ProgressBar
        from kpred.reports.batch_report import batch_report
        from kpred.reports.page import save_report

        source = self.source.resolve() if self.source.is_dir() else None
        with ProgressBar() as bar:
            text = batch_report(folder, source, lambda done, total: bar.update("drawing scans", done, total))
        save_report(file, text)
        output.note(f"wrote {file}")

    def _report(self, output: Output, report: BatchReport, target: Path) -> None:
        """Print the numbers, what failed and what was left out."""
        facts = {name: getattr(report, name) for name in ("fitted", "present", "retried", "left_out")}
        failed = [{"name": name, "problem": why} for name, why in report.failed]
        output.result({"path": target, **facts, "failed": failed})
        for name, why in report.failed[:10]:
            output.note(f"failed: {name}: {why}")
        if len(report.failed) > 10:
            output.note(f"failed: {len(report.failed) - 10} more ({target / 'failures.jsonl'} lists them)")
        if report.left_out:
            kinds = ", ".join(f"{count} {kind}" for kind, count in report.left_out.items())
            number = sum(report.left_out.values())
            output.note(f"left out: {number} file{'s' if number > 1 else ''} of kinds that are not read ({kinds})")
        done = f"{report.fitted} fitted, {report.present} already there, {len(report.failed)} failed"
        output.note(f"{target}: {done}")


COMMAND: type[Command] = FitManyCommand
