"""The server's workers: jobs wait in a line; a worker that takes too long or dies is replaced."""

from __future__ import annotations

import multiprocessing
import os
import threading
from collections import deque
from collections.abc import Callable
from concurrent.futures import Future
from typing import Protocol, runtime_checkable

from kpred.errors import ConfigError
from kpred.server.job import FitAnswer, FitJob
from kpred.server.worker import WorkerSettings, work

LOADING_SECONDS = 600.0
"""For a worker to load and warm up, code that must be compiled first included."""

DIED = "WorkerDied"
"""Kind of the answer where the process has died."""

LATE = object()
"""In place of a message that has not come in time."""


@runtime_checkable
class Pool(Protocol):
    """Whatever answers jobs."""

    @property
    def ready(self) -> int:
        """How many workers are loaded and warm."""
        ...

    @property
    def waiting(self) -> int:
        """How many jobs wait for a worker."""
        ...

    def submit(self, job: FitJob) -> Future[FitAnswer]:
        """Hand in a job; cancelling its future takes it out of the line."""
        ...


@runtime_checkable
class FitWorker(Protocol):
    """Whatever fits one scan after another."""

    @property
    def alive(self) -> bool:
        """Whether it can take another job."""
        ...

    def run(self, job: FitJob, seconds: float) -> FitAnswer:
        """Answer a job; afterwards it may be no longer alive."""
        ...

    def stop(self) -> None:
        """End it at once."""
        ...


class WorkerProcess:
    """One process that fits.

    Raises:
        ConfigError: it cannot load what it needs; the sentence says what.
    """

    def __init__(self, settings: WorkerSettings) -> None:
        """Start it and wait until it is warm."""
        context = multiprocessing.get_context("spawn")
        self._connection, other = context.Pipe()
        self._process = context.Process(target=work, args=(other, settings, os.getpid()), daemon=True)
        self._process.start()
        other.close()
        problem = self._receive(LOADING_SECONDS)
        if problem != "":
            self.stop()
            raise ConfigError(problem if isinstance(problem, str) else "A worker of the server could not start.")

    def run(self, job: FitJob, seconds: float) -> FitAnswer:
        """Return the answer to a job; where it takes longer, or the process dies, the process is ended."""
        try:
            self._connection.send(job)
        except OSError:
            return self._given_up(job, "the process that fitted it died; try again.", DIED)
        found = self._receive(seconds)
        if isinstance(found, FitAnswer):
            return found
        if found is LATE:
            return self._given_up(job, f"it took longer than {seconds:g} s and was given up.", "TimeLimit")
        return self._given_up(job, "the process that fitted it died; give a smaller scan.", DIED)

    @property
    def alive(self) -> bool:
        """Whether it can take another job."""
        return self._process.is_alive()

    def stop(self) -> None:
        """End the process at once."""
        self._process.kill()
        self._process.join()

    def _given_up(self, job: FitJob, why: str, kind: str) -> FitAnswer:
        self.stop()
        return FitAnswer(error=f"{job.shown}: {why}", kind=kind)

    def _receive(self, seconds: float) -> object:
        """Return the next message; `LATE` if there is none in time, None if the process has died."""
        try:
            return self._connection.recv() if self._connection.poll(seconds) else LATE
        except (EOFError, OSError):
            return None


class FitPool:
    """Workers and the line of jobs before them.

    Args:
        start: makes a worker. workers: how many. seconds: that one job may take.

    Raises:
        ConfigError: a worker cannot start.
    """

    def __init__(self, start: Callable[[], FitWorker], workers: int, seconds: float) -> None:
        self._start, self._seconds = start, seconds
        self._line: deque[tuple[FitJob, Future[FitAnswer]]] = deque()
        self._changed = threading.Condition()
        self._stopped = False
        self._workers: dict[int, FitWorker] = {}
        self._problem: ConfigError | None = None
        self._started = threading.Semaphore(0)
        self._threads = [
            threading.Thread(target=self._serve, args=(number,), name=f"kpred-fit-{number}")
            for number in range(workers)
        ]
        for thread in self._threads:
            thread.start()
        for _ in self._threads:
            self._started.acquire()
        if self._problem is not None:
            self.close()
            raise self._problem

    @property
    def ready(self) -> int:
        """How many workers are loaded and warm."""
        with self._changed:
            return sum(worker.alive for worker in self._workers.values())

    @property
    def waiting(self) -> int:
        """How many jobs wait for a worker."""
        return len(self._line)

    def submit(self, job: FitJob) -> Future[FitAnswer]:
        """Hand in a job; cancelling its future takes it out of the line."""
        future: Future[FitAnswer] = Future()
        future.add_done_callback(lambda done: self._drop(done) if done.cancelled() else None)
        with self._changed:
            self._line.append((job, future))
            self._changed.notify()
        return future

    def close(self) -> None:
        """End all workers; jobs that wait are cancelled."""
        with self._changed:
            self._stopped = True
            left = [future for _, future in self._line]
            running = list(self._workers.values())
            self._changed.notify_all()
        for worker in running:
            worker.stop()
        for future in left:
            future.cancel()
        for thread in self._threads:
            thread.join()

    def _drop(self, future: Future[FitAnswer]) -> None:
        with self._changed:
            self._line = deque(entry for entry in self._line if entry[1] is not future)

    def _serve(self, number: int) -> None:
        """Keep one worker running and give it jobs, until the pool is closed."""
        self._worker(number)
        self._started.release()
        while (entry := self._next()) is not None:
            job, future = entry
            if not future.set_running_or_notify_cancel():
                continue
            found = self._run(number, job)
            # It may have died before this scan, and not of it.
            future.set_result(self._run(number, job) if found.kind == DIED else found)
            self._worker(number)

    def _run(self, number: int, job: FitJob) -> FitAnswer:
        worker = self._worker(number)
        if worker is None:
            return FitAnswer(error=f"{job.shown}: {self._problem or 'the server is ending.'}", kind=DIED)
        return worker.run(job, self._seconds)

    def _worker(self, number: int) -> FitWorker | None:
        """Return the worker of a thread, a new one if it has none that lives; None if none can start."""
        with self._changed:
            before, stopped = self._workers.get(number), self._stopped
        if before is not None and before.alive:
            return before
        if stopped:
            return None
        try:
            started = self._start()
        except Exception as error:  # who waits for this thread must hear of it
            self._problem = error if isinstance(error, ConfigError) else ConfigError(f"A worker cannot start: {error}")
            return None
        with self._changed:
            self._workers[number] = started
            if self._stopped:
                started.stop()
        return started

    def _next(self) -> tuple[FitJob, Future[FitAnswer]] | None:
        with self._changed:
            while not self._line and not self._stopped:
                self._changed.wait()
            return None if self._stopped else self._line.popleft()
