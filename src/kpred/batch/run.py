"""A batch from beginning to end: tasks in, a few at a time; outcomes out; failures tried again, then listed."""

from __future__ import annotations

import os
from collections import deque
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field, replace
from pathlib import Path

from kpred.batch.journal import Journal
from kpred.batch.layout import lay_out
from kpred.batch.task import Task, other_files, read_tasks
from kpred.batch.worker import BatchSettings, Outcome
from kpred.batch.worker_pool import ProcessWorkerPool, WorkerPool
from kpred.errors import ConfigError

_WAITING = 2
"""Groups handed in for each worker: one that is worked on and one that waits; more would only fill the memory."""

_GROUP_SIZE = 8
"""Scans of a group where the networks can read several at once; more gain nothing (measured on a CPU)."""


@dataclass
class BatchReport:
    """What a run did.

    Attributes:
        fitted: scans fitted in this run; present: those done before; retried: attempts beyond each scan's first.
        failed: (name, reason) of the scans that were given up.
        left_out: how many files of a folder are no scans, by their extension.
    """

    fitted: int = 0
    present: int = 0
    retried: int = 0
    failed: list[tuple[str, str]] = field(default_factory=list)
    left_out: dict[str, int] = field(default_factory=dict)

    @property
    def handled(self) -> int:
        """Scans that are done with, one way or another."""
        return self.fitted + self.present + len(self.failed)


def fit_many(
    source: str | os.PathLike[str],
    out: str | os.PathLike[str],
    settings: BatchSettings | None = None,
    *,
    workers: int | None = None,
    ray: str | None = None,
    attempts: int = 3,
    gpus: float = 0.0,
    progress: Callable[[BatchReport], None] | None = None,
) -> BatchReport:
    """Fit all scans of a folder or Parquet manifest into the folder `out` (see `kpred.batch.journal` for its layout).

    A run that was stopped or killed goes on where it was when it is started again with the same arguments. Scans that
    failed are tried again by the next run. What may have been an accident (a dead worker, a full disk) is tried
    `attempts` times; after a worker died, what it may have been is tried alone.

    Args:
        source: the folder or the manifest (`kpred.batch.task.read_tasks`).
        settings: how the scans are fitted.
        workers: processes, one thread each; by default one a core, on Ray one a CPU of the cluster.
        ray: address of a Ray cluster, `auto` or `local`; None works with processes of this machine.
        gpus: fraction of a GPU that each worker on Ray takes; its networks then run there.
        progress: called after each scan.

    Raises:
        ManifestError: no scans there, no manifest, or `out` belongs to another batch or run.
        ConfigError: an impossible argument, no Ray, or too few GPUs. ModelError, DatabaseError: they cannot be opened.
    """
    if attempts < 1 or (workers is not None and workers < 1):
        raise ConfigError(f"A batch needs at least 1 worker and 1 attempt, not {workers} and {attempts}.")
    if gpus and ray is None:
        raise ConfigError("Fractions of a GPU are given out by Ray; name a cluster (--ray local), or take no GPU.")
    chosen = _absolute(settings or BatchSettings())
    if chosen.time_limit is not None and not 0 < chosen.time_limit < 1e7:
        raise ConfigError(f"The time limit of a scan is {chosen.time_limit}; it must be a number of seconds above 0.")
    place = Path(out).resolve()
    layout, tasks = lay_out(read_tasks(Path(source).resolve()), place, Path(source).resolve())
    _check_resources(chosen)
    job = {"source": str(Path(source).resolve()), **chosen.to_dict(), **layout.job}
    with Journal(place, job, layout.places) as journal:
        pool = _worker_pool(ray, workers, chosen, str(place), gpus)
        try:
            group_size = _GROUP_SIZE if chosen.batched else 1
            report = BatchRun(pool, journal, attempts, progress, group_size).run(tasks)
        finally:
            pool.close()
        journal.write_failures(report.failed)
    if Path(source).is_dir():
        report.left_out = other_files(Path(source))
    return report


class BatchRun:
    """One run: what waits to be tried again, and the report."""

    def __init__(
        self,
        pool: WorkerPool,
        journal: Journal,
        attempts: int,
        progress: Callable[[BatchReport], None] | None,
        group_size: int = 1,
    ) -> None:
        self.pool, self.journal, self.attempts, self.progress = pool, journal, attempts, progress
        self.group_size = group_size
        self.report = BatchReport()
        self.attempts_made: dict[str, int] = {}
        self.retry: deque[Task] = deque()
        self.suspects: deque[Task] = deque()

    def run(self, tasks: Iterator[Task]) -> BatchReport:
        running = 0
        while True:
            running += self._fill(tasks, running)
            if not running:
                return self.report
            for group, outcomes in self.pool.finished():
                running -= 1
                for row, task in enumerate(group):
                    self._take(task, None if outcomes is None else outcomes[row])

    def _fill(self, tasks: Iterator[Task], running: int) -> int:
        """Hand in what there is room for, and return how many groups that were."""
        if self.suspects:
            # What may have killed its worker runs alone: others would be taken down, and suspected, with it.
            return 0 if running else self._start([self.suspects.popleft()])
        started = 0
        while running + started < _WAITING * self.pool.size:
            group = [self.retry.popleft()] if self.retry else self._next_group(tasks)
            if not group:
                break
            started += self._start(group)
        return started

    def _start(self, group: list[Task]) -> int:
        for task in group:
            self.attempts_made[task.name] = self.attempts_made.get(task.name, 0) + 1
            self.report.retried += self.attempts_made[task.name] > 1
        self.pool.start(tuple(group))
        return 1

    def _next_group(self, tasks: Iterator[Task]) -> list[Task]:
        group: list[Task] = []
        while len(group) < self.group_size and (task := self._next(tasks)) is not None:
            group.append(task)
        return group

    def _next(self, tasks: Iterator[Task]) -> Task | None:
        """Return the next scan that is neither finished nor invalid, or None."""
        for task in tasks:
            if self.journal.is_done(task):
                self.report.present += 1
            elif task.problem:
                self.report.failed.append((task.name, task.problem))
            else:
                return task
            self._report_progress()
        return None

    def _take(self, task: Task, outcome: Outcome | None) -> None:
        if outcome is not None and outcome.row is not None:
            self.journal.done(task, outcome.row)
            self.report.fitted += 1
            self.attempts_made.pop(task.name, None)
        elif (outcome is None or outcome.retry) and self.attempts_made[task.name] < self.attempts:
            (self.suspects if outcome is None else self.retry).append(task)
            return
        else:
            reason = outcome.problem if outcome is not None else "the process that fitted it died"
            self.report.failed.append((task.name, reason))
        self._report_progress()

    def _report_progress(self) -> None:
        if self.progress is not None:
            self.progress(self.report)


def _absolute(settings: BatchSettings) -> BatchSettings:
    """Make paths absolute, for workers that run in another folder."""
    from kpred.database.address import is_address

    def absolute(name: str | None) -> str | None:
        if name is None or is_address(name) or not Path(name).exists():
            return name
        return str(Path(name).resolve())

    return replace(settings, model=absolute(settings.model), database=absolute(settings.database))


def _worker_pool(ray: str | None, workers: int | None, settings: BatchSettings, out: str, gpus: float) -> WorkerPool:
    if ray is not None:
        from kpred.batch.ray_pool import RayWorkerPool

        return RayWorkerPool(ray, workers, settings, out, gpus)
    cores = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
    return ProcessWorkerPool(workers or cores, settings, out)


def _check_resources(settings: BatchSettings) -> None:
    """Check settings, model and database once, before the first scan."""
    from kpred.exports.format_table import EXTENSIONS, check_extension
    from kpred.fitting.defaults import resolve_database, resolve_model, shared_categories

    if settings.mesh and settings.mesh not in EXTENSIONS:
        known = ", ".join(EXTENSIONS)
        raise ConfigError(f"Meshes cannot be written as {settings.mesh!r}; use one of {known}.")
    if settings.mesh:
        check_extension(f"the meshes of the batch{settings.mesh}")
    shared_categories(resolve_model(settings.model), resolve_database(settings.database), settings.category)


def count_scans(source: str | os.PathLike[str]) -> int | None:
    """Count the scans, or return None where that would need reading all of the source."""
    path = Path(source)
    if path.is_dir():
        return sum(1 for _ in read_tasks(path))
    try:
        from pyarrow import parquet

        return int(parquet.ParquetFile(path).metadata.num_rows)
    except Exception:  # `fit_many` says what is wrong
        return None
