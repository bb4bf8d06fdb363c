"""Worker pools: they take groups of tasks and return outcomes, on this machine or on a cluster."""

from __future__ import annotations

import multiprocessing
import os
from concurrent.futures import FIRST_COMPLETED, Future, ProcessPoolExecutor, wait
from concurrent.futures.process import BrokenProcessPool
from typing import Protocol, runtime_checkable

from kpred.batch.task import Task
from kpred.batch.worker import BatchSettings, Outcome, begin_worker, fit_tasks

Group = tuple[Task, ...]
"""Tasks that one worker takes together."""


@runtime_checkable
class WorkerPool(Protocol):
    """Workers. A group whose worker dies comes back with None instead of outcomes."""

    @property
    def size(self) -> int:
        """How many groups are worked on at once."""
        ...

    def start(self, group: Group) -> None:
        """Hand in a group of tasks."""
        ...

    def finished(self) -> list[tuple[Group, list[Outcome] | None]]:
        """Wait until a group is done, and return all that are."""
        ...

    def close(self) -> None:
        """Stop; what is being worked on is given up."""
        ...


class ProcessWorkerPool:
    """Processes on this machine, one thread each; new ones take the place of those that die."""

    def __init__(self, size: int, settings: BatchSettings, out: str) -> None:
        self.size = size
        self._settings, self._out = settings, out
        self._groups: dict[Future[list[Outcome]], Group] = {}
        self._pool = self._new_pool()

    def _new_pool(self) -> ProcessPoolExecutor:
        # Fresh interpreters: a forked one would share locks of torch's threads.
        context = multiprocessing.get_context("spawn")
        return ProcessPoolExecutor(self.size, mp_context=context, initializer=begin_worker, initargs=(os.getpid(),))

    def start(self, group: Group) -> None:
        """See `WorkerPool`."""
        try:
            future = self._pool.submit(fit_tasks, group, self._settings, self._out)
        except BrokenProcessPool:
            self._pool = self._new_pool()
            future = self._pool.submit(fit_tasks, group, self._settings, self._out)
        self._groups[future] = group

    def finished(self) -> list[tuple[Group, list[Outcome] | None]]:
        """See `WorkerPool`; when one process dies, all running groups come back with None."""
        done, _ = wait(self._groups, return_when=FIRST_COMPLETED)
        found: list[tuple[Group, list[Outcome] | None]] = []
        for future in done:
            group = self._groups.pop(future)
            try:
                found.append((group, future.result()))
            except BrokenProcessPool:
                found.append((group, None))
        return found

    def close(self) -> None:
        """See `WorkerPool`."""
        for process in list((getattr(self._pool, "_processes", None) or {}).values()):
            if self._groups:
                process.terminate()
        self._pool.shutdown(wait=True, cancel_futures=True)
