"""Workers that answer at once or when they are let, in place of processes."""

from collections.abc import Callable
from concurrent.futures import Future
from pathlib import Path

import pytest

from kpred.server.job import FitAnswer, FitJob

pytest.importorskip("fastapi", reason="fastapi is not installed (the extra serve)")


class Workers:
    """A pool that keeps its jobs; `answer` says what becomes of one, None leaves it waiting."""

    def __init__(self) -> None:
        self.ready, self.jobs, self.futures = 1, [], []
        self.uploads: list[bytes] = []
        self.answer: Callable[[FitJob], FitAnswer | None] = lambda job: FitAnswer(
            {job.mesh: b"glTF", Path(job.mesh).stem + ".json": b'{"category": "chair"}'}, {}, ("a note",)
        )

    @property
    def waiting(self) -> int:
        return sum(not future.done() for future in self.futures)

    def submit(self, job: FitJob) -> Future[FitAnswer]:
        future: Future[FitAnswer] = Future()
        self.uploads.append(Path(job.folder, job.scan).read_bytes())
        self.jobs.append(job)
        self.futures.append(future)
        if (found := self.answer(job)) is not None:
            future.set_result(found)
        return future


@pytest.fixture
def workers() -> Workers:
    return Workers()
