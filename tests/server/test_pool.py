"""The line before the workers: first come, first served; who leaves is not waited for; workers are replaced."""

import multiprocessing
import os
import threading
from collections.abc import Callable
from functools import partial
from multiprocessing.connection import Connection
from types import SimpleNamespace

import pytest

from kpred.errors import ConfigError
from kpred.server import pool as module
from kpred.server.job import FitAnswer, FitJob
from kpred.server.pool import FitPool, WorkerProcess
from kpred.server.worker import WorkerSettings


def job(name: str) -> FitJob:
    return FitJob("/none", "scan.ply", name, "result.glb", {})


class Worker:
    """In place of a process: it answers when it is let, and dies of scans called `kill`."""

    made = 0

    def __init__(self) -> None:
        type(self).made += 1
        self.alive, self.let, self.done = True, threading.Event(), []

    def run(self, job: FitJob, seconds: float) -> FitAnswer:
        self.let.wait()
        self.done.append(job.shown)
        self.alive = self.alive and job.shown != "kill"
        return FitAnswer(kind="" if self.alive else "WorkerDied")

    def stop(self) -> None:
        self.alive = False
        self.let.set()


@pytest.fixture
def made() -> list[Worker]:
    return []


@pytest.fixture
def pool(made: list[Worker]):
    def start() -> Worker:
        made.append(Worker())
        return made[-1]

    opened = FitPool(start, 1, 1.0)
    yield opened
    opened.close()


def test_jobs_are_done_in_turn_and_those_who_left_are_not(pool: FitPool, made: list[Worker]) -> None:
    futures = [pool.submit(job(name)) for name in "abcd"]
    while pool.waiting > 3:
        pass
    assert futures[2].cancel() and pool.waiting == 2
    assert not futures[0].cancel()
    made[0].let.set()
    assert futures[3].result(10) == FitAnswer()
    assert made[0].done == ["a", "b", "d"]


def test_a_worker_that_died_is_replaced_and_the_scan_tried_once_more(pool: FitPool, made: list[Worker]) -> None:
    first, second = pool.submit(job("kill")), pool.submit(job("b"))
    for number in range(3):
        while len(made) <= number:
            pass
        made[number].let.set()
    assert first.result(10).kind == "WorkerDied" and second.result(10) == FitAnswer()
    assert [worker.done for worker in made] == [["kill"], ["kill"], ["b"]] and pool.ready == 1


def test_closing_ends_those_who_work_and_who_wait(pool: FitPool, made: list[Worker]) -> None:
    working, waiting = pool.submit(job("a")), pool.submit(job("b"))
    while pool.waiting > 1:
        pass
    pool.close()
    assert waiting.cancelled() and working.done() and pool.ready == 0


def test_a_worker_that_cannot_start_is_named() -> None:
    def start() -> Worker:
        raise ConfigError("There is no database.")

    with pytest.raises(ConfigError, match="no database"):
        FitPool(start, 2, 1.0)


class Process:
    """In place of a process of the system: what it sends at its start, and no more."""

    def __init__(
        self, target: object, args: tuple[Connection, WorkerSettings, int], daemon: bool, first: object
    ) -> None:
        self.connection, self.first, self.killed = args[0], first, False

    def start(self) -> None:
        self.kept = Connection(os.dup(self.connection.fileno()))
        self.connection.send(self.first)

    def is_alive(self) -> bool:
        return not self.killed

    def kill(self) -> None:
        self.killed = True

    def join(self) -> None:
        pass


@pytest.fixture
def context(monkeypatch: pytest.MonkeyPatch) -> Callable[[object], None]:
    def use(first: object) -> None:
        made = SimpleNamespace(Pipe=multiprocessing.Pipe, Process=partial(Process, first=first))
        monkeypatch.setattr(module.multiprocessing, "get_context", lambda _: made)

    return use


def test_a_process_names_what_it_cannot_load(context: Callable[[object], None]) -> None:
    context("There is no database.")
    with pytest.raises(ConfigError, match="no database"):
        WorkerProcess(WorkerSettings())


def test_a_process_that_takes_too_long_is_ended(context: Callable[[object], None]) -> None:
    context("")
    worker = WorkerProcess(WorkerSettings())
    found = worker.run(job("a"), 0.01)
    assert (found.kind, worker.alive) == ("TimeLimit", False) and found.error.startswith(
        "a: it took longer than 0.01 s"
    )
