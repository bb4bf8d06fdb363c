"""Kernels shared among threads: every job is done once, whoever does it, and errors come back to the caller."""

import threading
import time

import numpy as np
import pytest

from kpred.ops import worksharing
from kpred.ops.worksharing import MIN_STEPS, parallel_for


@pytest.fixture(params=[1, 2, 5])
def threads(request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch) -> int:
    """As many as are asked for, though the machine may have fewer processors."""
    monkeypatch.setattr(worksharing, "thread_count", lambda: request.param)
    return int(request.param)


@pytest.mark.parametrize("jobs", [0, 1, 3, 100])
def test_every_job_is_done_once(threads: int, jobs: int) -> None:
    done = np.zeros(jobs, np.int64)

    def kernel(first: int, last: int) -> None:
        for job in range(first, last):
            done[job] += 1

    parallel_for(kernel, jobs, 100 * MIN_STEPS)
    assert (done == 1).all()


def test_small_work_stays_in_the_calling_thread(threads: int) -> None:
    seen = set()
    parallel_for(lambda first, last: seen.add(threading.get_ident()), 10, MIN_STEPS // 4)
    assert seen == {threading.get_ident()}


def test_an_error_of_any_slice_comes_back_and_nobody_works_on(threads: int) -> None:
    ended = []

    def kernel(first: int, last: int) -> None:
        time.sleep(0.01)
        ended.append(first)
        if first == 0:
            raise ValueError("the first slice fails")

    with pytest.raises(ValueError, match="the first slice"):
        parallel_for(kernel, 40, 100 * MIN_STEPS)
    count = len(ended)
    time.sleep(0.05)
    assert len(ended) == count
