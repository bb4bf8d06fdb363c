"""`kpred database`: the CAD models that are retrieved and deformed."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from tyro.conf import Positional, arg

from kpred.cli.command import Command
from kpred.cli.output import Output
from kpred.cli.usage import UsageError
from kpred.database.address import masked

if TYPE_CHECKING:
    from kpred.batch.ray_encoder import RayEncoder
    from kpred.nn import Model

DatabasePath = Annotated[Positional[str], arg(metavar="DATABASE")]
Source = Annotated[Positional[Path], arg(metavar="PACK_OR_FOLDER")]


@dataclass(frozen=True, kw_only=True)
class _Encoding(Command):
    """What building and adding have in common."""

    category: Annotated[str | None, arg(metavar="NAME")] = None
    """Take this category only; for a folder that names none, the category of its meshes"""
    split: Annotated[str | None, arg(metavar="NAME")] = None
    """Take this split of a pack only: source, train or val"""
    model: Annotated[str | None, arg(metavar="NAME_OR_PATH")] = None
    """Trained networks: a name or a folder; without it, the bundled ones"""
    batch: Annotated[int, arg(metavar="N")] = 16
    """Models encoded together and written in one transaction"""
    seed: Annotated[int, arg(metavar="SEED")] = 0
    """Of the points sampled on the models"""
    workers: Annotated[int | None, arg(metavar="N")] = None
    """Processes that encode, one thread each; without it this one, with its threads (on Ray, one a CPU)"""
    ray: Annotated[str | None, arg(metavar="ADDRESS")] = None
    """Encode on a Ray cluster: auto, local or its address; only this machine needs to see meshes and database"""
    gpus_per_worker: Annotated[float, arg(metavar="SHARE")] = 0.0
    """Share of a GPU that each worker on Ray takes (0.25: four share one); its networks then run there"""

    def encode(self, output: Output, source: Path, file: str, resume: bool) -> None:
        """Encode the shapes of `source` into `file`, with a progress bar, and print what was done."""
        from kpred.cli.progress import ProgressBar
        from kpred.database import Database, build_database
        from kpred.errors import DatabaseError
        from kpred.nn import load_model
        from kpred.shapes import open_shapes

        if self.gpus_per_worker and self.ray is None:
            raise UsageError("--gpus-per-worker needs --ray (auto, local or an address)")
        unreadable: list[str] = []
        is_new = not Database.exists(file)
        shapes = open_shapes(source, self.category, self.split, report=unreadable.append)
        model = load_model(self.model)
        try:
            with self._cluster(model) as encoder, ProgressBar() as bar:
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
                )
                if report.added:
                    with Database.open(file) as database:
                        database.prepare_search(lambda done, total: bar.update("preparing search", done, total))
        except BaseException as error:
            if is_new:
                _drop_if_empty(file)
            if isinstance(error, KeyboardInterrupt) and resume and Database.exists(file):
                raise KeyboardInterrupt(f"{masked(file)} is whole, and the same command goes on with it") from error
            raise
        left_out = unreadable + [f"{name}: {reason}" for name, reason in report.failed]
        if not report.added and not report.skipped_present:
            if is_new:
                _drop_if_empty(file)
            why = left_out[0] if left_out else "no shape of that category and split is there"
            raise DatabaseError(f"{source}: nothing could be put into {masked(file)}; {why}")
        facts = {"path": masked(file), "added": report.added, "present": report.skipped_present, "left_out": left_out}
        output.result(facts)
        for sentence in left_out[:10]:
            output.note(f"left out: {sentence}")
        if len(left_out) > 10:
            output.note(f"left out: {len(left_out) - 10} more (--json lists them)")
        output.note(
            f"{masked(file)}: {report.added} added, {report.skipped_present} already there, {len(left_out)} left out"
        )

    @contextmanager
    def _cluster(self, model: Model) -> Iterator[RayEncoder | None]:
        """The workers of a Ray cluster, where one is asked for."""
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


@dataclass(frozen=True, kw_only=True)
class BuildCommand(_Encoding):
    """Build a database from a mesh pack, a folder of packs or of meshes, or a Parquet manifest of mesh files.

    A build that was stopped goes on where it was when the same command is given again.

    examples:
      kpred database build meshes/ -o mine.kpred
      kpred database build chair.npz --split source -o chairs.kpred
      kpred database build my_chairs/ --category chair --model runs/chair/model -o chairs.kpred
      kpred database build catalogue.parquet -o mine.kpred --ray auto
    """

    source: Source
    """Mesh pack (.npz), folder of packs or of .obj .glb .gltf .ply .stl .off files, or manifest (.parquet)"""
    output: Annotated[str, arg(aliases=["-o"], metavar="FILE")]
    """The database to write: a file (.kpred) or postgresql://user@host/name"""
    resume: Annotated[bool, arg(help_behavior_hint="")] = True
    """Build anew beside an existing file and take its place at the end"""

    def run(self, output: Output) -> None:
        """Build and print the numbers."""
        self.encode(output, self.source, self.output, self.resume)


@dataclass(frozen=True, kw_only=True)
class AddCommand(_Encoding):
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


@dataclass(frozen=True, kw_only=True)
class RemoveCommand(Command):
    """Remove models from a database by their ids; all of them or, when one is not there, none.

    examples:
      kpred database remove mine.kpred chair_0001 chair_0007
    """

    file: DatabasePath
    """An existing database: a file or postgresql://user@host/name"""
    model_ids: Annotated[Positional[tuple[str, ...]], arg(metavar="MODEL_ID [MODEL_ID ...]", help_behavior_hint="")]
    """Ids of the models"""

    def run(self, output: Output) -> None:
        """Remove and print the number."""
        from kpred.database import Database

        if not self.model_ids:
            raise UsageError("no model was named; `kpred database search` and `info` show what there is")
        with Database.open(self.file) as database:
            removed = database.remove(self.model_ids)
        output.result({"path": masked(self.file), "removed": removed})
        output.note(f"{masked(self.file)}: {removed} removed")


@dataclass(frozen=True, kw_only=True)
class InfoCommand(Command):
    """Say what a database holds, and which weights made it.

    examples:
      kpred database info mine.kpred
      kpred database info mine.kpred --ids --json
    """

    file: DatabasePath
    """An existing database: a file or postgresql://user@host/name"""
    ids: Annotated[bool, arg(help_behavior_hint="")] = False
    """List the ids of the models too"""

    def run(self, output: Output) -> None:
        """Print the facts."""
        from kpred.database import Database

        with Database.open(self.file, read_only=True) as database:
            facts = database.info()
            ids = {name: database.model_ids(name) for name in facts["categories"]} if self.ids else {}
        output.result(facts | ({"model_ids": ids} if self.ids else {}))
        rows = [
            (name, c["models"], c["keypoints"], c["token_size"], c["model_name"], c["fingerprint"])
            for name, c in facts["categories"].items()
        ]
        title = f"{facts['path']}: {facts['models']} models, {facts['bytes'] / 1e6:.1f} MB"
        output.table(title, ["category", "models", "keypoints", "token", "model", "weights"], rows)
        for name, model_ids in ids.items():
            output.note("\n".join(f"{name}  {model_id}" for model_id in model_ids))


@dataclass(frozen=True, kw_only=True)
class SearchCommand(Command):
    """List the models of a database that retrieval finds for a scan, nearest first.

    examples:
      kpred database search mine.kpred chair.ply --category chair
      kpred database search mine.kpred scan.npy --top-k 25 --json
    """

    file: DatabasePath
    """An existing database: a file or postgresql://user@host/name"""
    scan: Annotated[Positional[Path], arg(metavar="SCAN")]
    """Point cloud or mesh of one object"""
    category: Annotated[str | None, arg(metavar="NAME")] = None
    """Search this category; without it, the one that fits best"""
    model: Annotated[str | None, arg(metavar="NAME_OR_PATH")] = None
    """Trained networks: a name or a folder; without it, the bundled ones"""
    top_k: Annotated[int, arg(metavar="K")] = 10
    """How many models to list"""

    def run(self, output: Output) -> None:
        """Search and print the models."""
        from kpred.database import Database
        from kpred.fitting.fit_scan import fit
        from kpred.nn import load_model
        from kpred.shapes import read_scan

        scan = read_scan(self.scan)
        with Database.open(self.file, read_only=True) as database:
            model = load_model(self.model)
            result = fit(scan, model, database, category=self.category, top_k=self.top_k, refine=False)
        rows = [
            {"model_id": found.model_id, "category": found.category, "token_distance": found.distance}
            for found in sorted(result.candidates, key=lambda found: found.distance)
        ]
        output.result(rows)
        output.table(f"models for {self.scan}", list(rows[0]), [list(row.values()) for row in rows])


def _drop_if_empty(place: str) -> None:
    """Take back a file that was made for a build which then put nothing into it; a server's tables stay."""
    from kpred.database import Database
    from kpred.errors import DatabaseError

    try:
        with Database.open(place, read_only=True) as database:
            file, empty = database.path, not len(database)
    except DatabaseError:
        return
    if empty and isinstance(file, Path):
        file.unlink(missing_ok=True)


@dataclass(frozen=True, kw_only=True)
class CopyCommand(Command):
    """Copy a database into another, from a file to a server or back, and compare the two.

    A copy that was stopped goes on where it was when the same command is given again. Models that only TARGET has stay.

    examples:
      kpred database copy mine.kpred postgresql://me@host/models
      kpred database copy postgresql://me@host/models mine.kpred
    """

    source: Annotated[Positional[str], arg(metavar="SOURCE")]
    """An existing database: a file or postgresql://user@host/name"""
    target: Annotated[Positional[str], arg(metavar="TARGET")]
    """Where to copy it; made where there is none"""
    batch: Annotated[int, arg(metavar="N")] = 64
    """Models copied in one transaction"""

    def run(self, output: Output) -> None:
        """Copy, compare, and print the numbers."""
        from kpred.cli.progress import ProgressBar
        from kpred.database import copy_database

        if self.batch < 1:
            raise UsageError("--batch must be at least 1.")
        with ProgressBar() as bar:
            report = copy_database(self.source, self.target, batch=self.batch, progress=bar.update)
        output.result({"source": masked(self.source), "target": masked(self.target), **report.__dict__})
        output.note(f"{report.copied} copied, {report.present} already there, all {report.verified} are the same")


COMMAND: dict[str, type[Command]] = {
    "build": BuildCommand,
    "add": AddCommand,
    "remove": RemoveCommand,
    "info": InfoCommand,
    "search": SearchCommand,
    "copy": CopyCommand,
}
