"""Building a database file from meshes, batch by batch, so that a killed build goes on where it stopped."""

from __future__ import annotations

import os
import tempfile
from collections import deque
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from pathlib import Path

from kpred.database.address import is_address
from kpred.database.connection import check_replaceable, explained
from kpred.database.database import Database
from kpred.database.encode import POINTS, prepare_mesh
from kpred.database.encoders import Batch, Encoder, ProcessEncoder, SerialEncoder
from kpred.database.entry import APPEARANCE, Entry
from kpred.database.fingerprint import CONTENT
from kpred.errors import DatabaseError, MeshError
from kpred.locks import exclusive
from kpred.nn import KPRed
from kpred.nn.model import network_of
from kpred.shapes.mesh import Mesh, clean_mesh_rows, mesh_hash
from kpred.shapes.source import Shape


@dataclass
class BuildReport:
    """What a build did.

    Attributes:
        added: models encoded and put into the file.
        skipped_present: models that were in the file already, with the same mesh.
        replaced: models that were in the file with another mesh, and took its place.
        changed: ids of models that are in the file with another mesh, which was kept.
        failed: (model id, reason) of the models left out.
    """

    added: int = 0
    skipped_present: int = 0
    replaced: int = 0
    changed: list[str] = field(default_factory=list)
    failed: list[tuple[str, str]] = field(default_factory=list)

    @property
    def handled(self) -> int:
        """Models that are done with, one way or another."""
        return self.added + self.skipped_present + self.replaced + len(self.changed) + len(self.failed)


def build_database(
    path: str | os.PathLike[str],
    shapes: Iterable[Shape | tuple[str, str, str, Mesh]],
    model: Mapping[str, KPRed],
    batch: int = 16,
    seed: int = 0,
    resume: bool = True,
    progress: Callable[[int], None] | None = None,
    workers: int = 1,
    encoder: Encoder | None = None,
    update: bool = False,
    keep_empty: bool = True,
    count: int = POINTS,
) -> BuildReport:
    """Encode shapes (model id, category, split, mesh, ...) and put them into the database at `path`.

    Every `batch` models of a category are one transaction. With `resume` an existing file is added to, and models that
    are in it are skipped: a build that was killed goes on and ends with the content of one that was not. Without it
    the database is built beside an existing file and takes its place at the end. Broken meshes, and models of
    categories that the model does not know, are left out and listed. The split, a hash of the mesh, and what is known
    of a shape (`kpred.shapes.Shape.details`) are recorded as metadata.

    Args:
        path: the file or the server's address; made when there is no database.
        shapes: read one at a time.
        model: a `kpred.nn.Model`, or a mapping from category to network.
        batch: models encoded together.
        seed: of the points sampled on the models.
        resume: see above.
        progress: called with the number of shapes that are done with, after each of them and after each batch.
        workers: processes that encode, one thread each; 1 is this process alone, with its threads. The content of the
            database does not depend on it, but for the last digits of sums.
        update: replace models that are in the file with another mesh or other details; else they are kept and listed.
        keep_empty: keep a file that this build made and put nothing into.
        count: points sampled on each model.
        encoder: who encodes instead, such as the workers of a cluster (`kpred.batch.ray_encoder`); it is not closed.

    Raises:
        DatabaseError: the file is not a database, was made by other weights, is locked, is being built by another
            process, or cannot be written.
    """
    if batch < 1 or workers < 1:
        raise DatabaseError(
            f"Database {path}: a build needs at least 1 model a batch and 1 worker, not {batch}, {workers}."
        )
    own: Encoder | None = None
    if encoder is None:
        own = encoder = SerialEncoder(model) if workers == 1 else ProcessEncoder(model, workers)
    try:
        with _alone(path):
            plan = _Plan(batch, seed, update, count)
            return _built(
                path, lambda found: _Build(found, model, plan, progress, encoder).run(shapes), resume, keep_empty
            )
    finally:
        if own is not None:
            own.close()


@dataclass(frozen=True)
class _Plan:
    batch: int
    seed: int
    update: bool
    count: int


@contextmanager
def _alone(path: str | os.PathLike[str]) -> Iterator[None]:
    """Let one process at a time build a file; a server takes several, and each model once."""
    if is_address(path):
        yield
        return
    file = Path(path)
    with explained(file):
        file.parent.mkdir(parents=True, exist_ok=True)
    busy = DatabaseError(f"Database {file}: another process is building it; wait until that ends and try again.")
    with exclusive(file.with_name(f".{file.name}.lock"), busy):
        yield


def _built(
    path: str | os.PathLike[str], run: Callable[[Database], BuildReport], resume: bool, keep_empty: bool
) -> BuildReport:
    """Run a build in the database at a place, or in a new file that takes this place at the end."""
    there = Database.exists(path)
    if resume or not there:
        try:
            with open_or_create(path, there) as database:
                return run(database)
        finally:
            if not (there or keep_empty or is_address(path)):
                _drop_if_empty(Path(path))
    if is_address(path):
        raise DatabaseError(f"Database {path} is on a server and cannot be built anew; drop its schema kpred first.")
    target = Path(path)
    check_replaceable(target)
    with explained(target), tempfile.TemporaryDirectory(prefix=".kpred-", dir=target.parent) as folder:
        with Database.create(Path(folder) / target.name) as database:
            report = run(database)
        os.replace(Path(folder) / target.name, target)
    return report


def open_or_create(path: str | os.PathLike[str], exists: bool) -> Database:
    """Open the database at a place, or create it; one that another process creates meanwhile is opened.

    Args:
        exists: whether there was a database a moment ago.

    Raises:
        DatabaseError: it can be neither opened nor created.
    """
    if exists:
        return Database.open(path)
    try:
        return Database.create(path)
    except DatabaseError:
        if not Database.exists(path):
            raise
        return Database.open(path)


def _drop_if_empty(file: Path) -> None:
    try:
        with Database.open(file, read_only=True) as database:
            empty = not len(database)
    except DatabaseError:
        return
    if empty:
        file.unlink(missing_ok=True)


class _Build:
    """One run of a build: what is waiting in each category, and the report."""

    def __init__(
        self,
        database: Database,
        model: Mapping[str, KPRed],
        plan: _Plan,
        progress: Callable[[int], None] | None,
        encoder: Encoder,
    ) -> None:
        database.check_model(model)
        self.database = database
        self.model = model
        self.encoder = encoder
        self.started: deque[tuple[list[str], Callable[[], list[Entry]]]] = deque()
        self.model_name = str(getattr(model, "name", ""))
        self.plan = plan
        self.progress = progress
        self.report = BuildReport()
        self.seen = set(database.model_ids())
        self.present = frozenset(self.seen)
        self.done: set[str] = set()
        self.appearances: dict[str, bytes] = {}
        self.waiting: dict[str, Batch] = {}

    def run(self, shapes: Iterable[Shape | tuple[str, str, str, Mesh]]) -> BuildReport:
        for item in shapes:
            shape = Shape(*item)
            # Meshes are prepared before they count toward a batch: a broken one then leaves the batches as they are,
            # also when it is tried again by a build that goes on.
            self._take(shape)
            if len(self.waiting.get(shape.category, ())) >= self.plan.batch:
                self._encode(shape.category)
            self._report()
        for category in list(self.waiting):
            self._encode(category)
            self._report()
        while self.started:
            self._commit()
            self._report()
        return self.report

    def _take(self, shape: Shape) -> None:
        model_id = shape.model_id
        is_present = model_id in self.present
        if model_id in self.done or (model_id in self.seen and not is_present):
            self.report.failed.append((model_id, "another shape of this source has the same id"))
            return
        self.seen.add(model_id)
        self.done.add(model_id)
        if network_of(self.model, shape.category) is None:
            self.report.failed.append((model_id, f"the model knows no category {shape.category!r}"))
            return
        try:
            mesh, kept = clean_mesh_rows(replace(shape.mesh, name=model_id))
            metadata = {**shape.details, "split": shape.split, CONTENT: mesh_hash(mesh)}
            appearance = None if shape.appearance is None else shape.appearance.reindexed(kept)
            if appearance is not None:
                metadata[APPEARANCE] = appearance.digest()
            if is_present and self._is_kept(shape, metadata):
                return
            prepared = prepare_mesh(shape.mesh, model_id, self.plan.seed, self.plan.count)
        except MeshError as error:
            self.report.failed.append((model_id, str(error)))
            return
        if appearance is not None:
            self.appearances[model_id] = appearance.pack()
        self.waiting.setdefault(shape.category, []).append((prepared, metadata))

    def _is_kept(self, shape: Shape, metadata: Mapping[str, str]) -> bool:
        """Test whether a model of the database stays as it is, and count it."""
        known = self.database.metadata(shape.model_id)
        content = known.get(CONTENT) or mesh_hash(self.database.entry(shape.model_id).mesh)
        is_same = content == metadata[CONTENT]
        details = {key: value for key, value in known.items() if key not in (CONTENT, "split")}
        wanted = {key: value for key, value in metadata.items() if key not in (CONTENT, "split")}
        if self.plan.update and not (is_same and details == wanted):
            return False
        if is_same:
            self.report.skipped_present += 1
        else:
            self.report.changed.append(shape.model_id)
        return True

    def _encode(self, category: str) -> None:
        batch = self.waiting.pop(category, [])
        self.started.append(([item.model_id for item, _ in batch], self.encoder.start(category, batch)))
        while len(self.started) > self.encoder.max_pending:
            self._commit()

    def _commit(self) -> None:
        """Put the batch that was handed in first into the database."""
        names, found = self.started.popleft()
        encoded, entries = found(), []
        died = set(names) - {entry.model_id for entry in encoded}
        self.report.failed += [(name, "the process that encoded it died") for name in names if name in died]
        for entry in encoded:
            try:
                entry.check()
            except DatabaseError as error:
                self.report.failed.append((entry.model_id, str(error)))
            else:
                entries.append(replace(entry, appearance=self.appearances.pop(entry.model_id, None)))
        replaced = {entry.model_id for entry in entries} & self.present
        count = self.database.add(entries, model_name=self.model_name, replace=bool(replaced))
        self.report.replaced += len(replaced)
        self.report.added += count - len(replaced)

    def _report(self) -> None:
        if self.progress is not None:
            self.progress(self.report.handled)
