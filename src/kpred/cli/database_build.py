"""`kpred database build` and `add`: encoding CAD models into a database."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

from tyro.conf import Positional, arg

from kpred.cli.command import NetworkCommand
from kpred.cli.output import Output
from kpred.cli.stopping import resumable
from kpred.cli.usage import UsageError
from kpred.database.address import masked

if TYPE_CHECKING:
    from kpred.batch.ray_encoder import RayEncoder
    from kpred.database import BuildReport
    from kpred.nn import Model

DatabasePath = Annotated[Positional[str], arg(metavar="DATABASE")]
Source = Annotated[Positional[Path], arg(metavar="PACK_OR_FOLDER")]


@dataclass(frozen=True, kw_only=True)
class EncodingCommand(NetworkCommand):
    """What building and adding have in common."""

    category: Annotated[str | None, arg(metavar="NAME")] = None
    """Take this category only; for a folder that names none, the category of its meshes"""
    split: Annotated[str | None, arg(metavar="NAME")] = None
    """Take this split of a pack only: source, train or val"""
    up: Literal["x", "y", "z", "-x", "-y", "-z"] = "y"
    """Up axis of the meshes; they are rotated so that it is y"""
    batch: Annotated[int, arg(metavar="N")] = 16
    """Models encoded together and written in one transaction"""
    seed: Annotated[int, arg(metavar="SEED")] = 0
    """Of the points sampled on the models"""
    workers: Annotated[int | None, arg(metavar="N")] = None
    """Processes that encode, one thread each; without it this one, with its threads (on Ray, one a CPU)"""
    ray: Annotated[str | None, arg(metavar="ADDRESS")] = None
    """Encode on a Ray cluster: auto, local or its address; only this machine needs to see meshes and database"""
    gpus_per_worker: Annotated[float, arg(metavar="FRACTION")] = 0.0
    """Fraction of a GPU that each worker on Ray takes (0.25: four share one); its networks then run there"""

    appearance: Annotated[bool, arg(help_behavior_hint="")] = True
    """Keep no materials, textures, names and UVs of OBJ and glTF files, so that the database is smaller"""
    update: Annotated[bool, arg(help_behavior_hint="")] = False
    """Replace models that the database holds with another mesh or other details; else they are kept and named"""

    def encode(self, output: Output, source: Path, file: str, resume: bool) -> None:
        """Encode the shapes of `source` into `file`, with a progress bar, and print what was done."""
        from kpred.cli.progress import ProgressBar
        from kpred.database import Database, build_database
        from kpred.database.model_check import ModelCheck
        from kpred.errors import DatabaseError
        from kpred.nn import load_model
        from kpred.shapes import open_shapes

        if self.gpus_per_worker and self.ray is None:
            raise UsageError("--gpus-per-worker needs --ray (auto, local or an address)")
        unreadable: list[str] = []
        model = load_model(self.model)
        check = ModelCheck(model.recognizer, self.up)
        shapes = check.watch(open_shapes(source, self.category, self.split, unreadable.append, self.appearance))
        kept = f"{masked(file)} is whole, and the same command goes on with it"
        with (
            resumable(kept, lambda: resume and Database.exists(file)),
            self._cluster(model) as encoder,
            ProgressBar() as bar,
        ):
            report = build_database(
                file,
                shapes,
                model,
                batch=self.batch,
                seed=self.seed,
                resume=resume,
                workers=1 if self.workers is None else self.workers,
                progress=lambda done: bar.update("encoding models", done),
                encoder=encoder,
                update=self.update,
                keep_empty=False,
            )
            if report.added or report.replaced:
                with Database.open(file) as database:
                    database.prepare_search(lambda done, total: bar.update("preparing search", done, total))
        left_out = unreadable + [f"{name}: {reason}" for name, reason in report.failed]
        if not (report.added or report.skipped_present or report.replaced or report.changed):
            why = left_out[0] if left_out else "no shape of that category and split is there"
            raise DatabaseError(f"{source}: nothing could be put into {masked(file)}; {why}")
        _print_report(output, masked(file), report, left_out, check.warnings())

    @contextmanager
    def _cluster(self, model: Model) -> Iterator[RayEncoder | None]:
        """Connect to the Ray cluster named by the options, or return None."""
        if self.ray is None:
            yield None
            return
        from kpred.batch.ray_encoder import RayEncoder

        if self.workers is not None and self.workers < 1:
            raise UsageError("--workers must be at least 1.")
        encoder = RayEncoder(model, self.ray, self.workers, self.gpus_per_worker)
        try:
            yield encoder
        finally:
            encoder.close()


def _print_report(
    output: Output, file: str, report: BuildReport, left_out: Sequence[str], warnings: Sequence[str]
) -> None:
    """Print what was put into a database and what was not."""
    there = report.skipped_present + report.replaced + len(report.changed)
    facts = {"path": file, "added": report.added, "present": report.skipped_present, "left_out": list(left_out)}
    facts |= {"replaced": report.replaced, "changed": report.changed}
    output.result(facts | {"warnings": list(warnings)})
    if report.changed:
        named = ", ".join(report.changed[:5]) + (", ..." if len(report.changed) > 5 else "")
        output.caution(
            f"{len(report.changed)} models are in {file} with another mesh, which was kept ({named}); "
            "--update replaces them."
        )
    for sentence in left_out[:10]:
        output.note(f"left out: {sentence}")
    if len(left_out) > 10:
        output.note(f"left out: {len(left_out) - 10} more (--json lists them)")
    output.note(
        f"{file}: {report.added} added, {report.replaced} replaced, "
        f"{there - report.replaced} already there, {len(left_out)} left out"
    )
    for sentence in warnings:
        output.caution(sentence)


@dataclass(frozen=True, kw_only=True)
class BuildCommand(EncodingCommand):
    """Build a database from a mesh pack, a folder of packs or of meshes, or a manifest of mesh files.

    A build that was stopped goes on where it was when the same command is given again.

    examples:
      kpred database build meshes/ -o mine.kpred
      kpred database build chair.npz --split source -o chairs.kpred
      kpred database build my_chairs/ --category chair --model runs/chair/model -o chairs.kpred
      kpred database build catalogue.parquet -o mine.kpred --ray auto
    """

    source: Source
    """Mesh pack (.npz), folder of packs or .obj .glb .gltf .ply .stl .off files, or manifest (.csv, .json, .parquet)"""
    output: Annotated[str, arg(aliases=["-o"], metavar="FILE")]
    """The database to write: a file (.kpred) or postgresql://user@host/name"""
    resume: Annotated[bool, arg(help_behavior_hint="")] = True
    """Build anew beside an existing file and take its place at the end"""

    def run(self, output: Output) -> None:
        """Build and print the numbers."""
        self.encode(output, self.source, self.output, self.resume)


@dataclass(frozen=True, kw_only=True)
class AddCommand(EncodingCommand):
    """Add the models of a mesh pack or folder to an existing database.

    examples:
      kpred database add mine.kpred more_chairs/ --category chair
      kpred database add mine.kpred table.npz --split source
    """

    file: DatabasePath
    """An existing database: a file or postgresql://user@host/name"""
    source: Source
    """Mesh pack (.npz), folder of packs, or folder of meshes"""

    def run(self, output: Output) -> None:
        """Add and print the numbers."""
        from kpred.database import Database
        from kpred.errors import DatabaseError

        if not Database.exists(self.file):
            raise DatabaseError(f"{masked(self.file)}: there is no such database; `kpred database build` makes one.")
        self.encode(output, self.source, self.file, resume=True)
