"""`kpred data check` and `prepare`: data sets as they were downloaded."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

from tyro.conf import Positional, arg

from kpred.cli.command import Command
from kpred.cli.output import Output
from kpred.cli.stopping import resumable

if TYPE_CHECKING:
    from kpred.datasets import Dataset, Issue

Kind = Literal["auto", "shapenet", "scan2cad", "modelnet", "packs", "folder"]

SHOWN = 20
"""Missing things that are named for people; --json names all."""


@dataclass(frozen=True, kw_only=True)
class _DatasetCommand(Command):
    """Which data set."""

    path: Annotated[Positional[Path], arg(metavar="PATH")]
    """Folder of the data set, or a mesh pack"""
    kind: Kind = "auto"
    """Its layout; auto goes by what is there"""
    split_file: Annotated[Path | None, arg(metavar="CSV")] = None
    """ShapeNet: the split (columns synsetId, modelId, split)"""
    scannet: Annotated[Path | None, arg(metavar="FOLDER")] = None
    """Scan2CAD: where ScanNet's scans are, if not below PATH"""
    shapenet: Annotated[Path | None, arg(metavar="FOLDER")] = None
    """Scan2CAD: where ShapeNet's synsets are, if not below PATH"""
    category: Annotated[str | None, arg(metavar="NAME")] = None
    """Only this category (chair, table, cabinet, ...)"""

    def dataset(self) -> Dataset:
        """Open the data set that the options name."""
        from kpred.datasets import open_dataset

        return open_dataset(
            self.path,
            None if self.kind == "auto" else self.kind,
            split_file=self.split_file,
            scannet=self.scannet,
            shapenet=self.shapenet,
            category=self.category,
        )


@dataclass(frozen=True, kw_only=True)
class CheckCommand(_DatasetCommand):
    """Say what a data set has and what is missing; the exit code is 1 if anything is.

    Layouts: ShapeNet with a split file, Scan2CAD on ScanNet, ModelNet, mesh packs, any folder of meshes. Meshes are not
    read (`kpred data prepare` does that), but those of packs.

    examples:
      kpred data check ShapeNetCore.v2 --split-file split.csv --category chair
      kpred data check Scan2CAD --scannet scans --shapenet ShapeNetCore.v2
      kpred data check ModelNet40
      kpred data check sa_partnet --json
    """

    def run(self, output: Output) -> None:
        """Look, print the numbers and what is missing."""
        from kpred.errors import PackError

        check = self.dataset().check()
        output.result(check.to_json())
        rows = [(category, split, count) for category, row in check.found.items() for split, count in row.items()]
        output.table(f"{check.path}: {check.kind}", ["category", "split", "found"], rows)
        for remark in check.remarks:
            output.note(f"note: {remark}")
        if not check.complete:
            _print_lacks(output, "missing or broken", check.issues)
            counts = Counter(issue.what for issue in check.issues)
            numbers = ", ".join(f"{count} x {what}" for what, count in counts.items())
            raise PackError(f"{check.path}: it is not complete ({numbers}); the list says what to do.")
        output.note("complete")


@dataclass(frozen=True, kw_only=True)
class PrepareCommand(_DatasetCommand):
    """Make mesh packs of a data set, one for each category, with its splits.

    Meshes are read by several processes and kept in FOLDER/cache by their content: a preparation that was stopped goes
    on when the same command is given again. Meshes that cannot be read are left out, counted and listed.

    examples:
      kpred data prepare ShapeNetCore.v2 --split-file split.csv -o packs/
      kpred data prepare ModelNet40 --category chair -o packs/
      kpred data prepare Scan2CAD --shapenet ShapeNetCore.v2 -o packs/
    """

    output: Annotated[Path, arg(aliases=["-o"], metavar="FOLDER")]
    """Where the packs go"""
    workers: Annotated[int, arg(metavar="N")] = 2
    """Processes that read"""

    def run(self, output: Output) -> None:
        """Read with a progress bar, print the numbers and what was left out."""
        from kpred.cli.progress import ProgressBar
        from kpred.datasets import prepare_dataset

        with resumable(f"{self.output} keeps what was read, and the same command goes on"), ProgressBar() as bar:
            done = prepare_dataset(self.dataset(), self.output, self.workers, bar.update)
        output.result(done.to_json())
        rows = [
            (category, split, count, done.packs[category])
            for category, row in done.found.items()
            for split, count in row.items()
        ]
        output.table("mesh packs", ["category", "split", "shapes", "file"], rows)
        output.note(f"{done.read} meshes read, {done.kept} taken from the cache, {len(done.skipped)} left out")
        if done.skipped:
            _print_lacks(output, "left out", done.skipped)


def _print_lacks(output: Output, title: str, issues: tuple[Issue, ...]) -> None:
    output.table(title, ["what", "name", "why"], [(issue.what, issue.name, issue.why) for issue in issues[:SHOWN]])
    if len(issues) > SHOWN:
        output.note(f"and {len(issues) - SHOWN} more; --json names all")
