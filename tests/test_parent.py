"""Workers end with their parent, whatever ends it."""

import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable

import pytest

PARENT = """
import multiprocessing, os, sys, time
from concurrent.futures import ProcessPoolExecutor
from kpred import parent

def pid(_):
    time.sleep(0.2)
    return os.getpid()

def begin(number, kernel):
    if not kernel:
        parent._request_signal, parent.POLL_SECONDS = lambda: False, 0.1
    parent.end_with_parent(number)

if __name__ == "__main__":
    arguments = os.getpid(), sys.argv[1] == "kernel"
    pool = ProcessPoolExecutor(2, multiprocessing.get_context("spawn"), initializer=begin, initargs=arguments)
    print(*set(pool.map(pid, range(4))), flush=True)
    jobs = [pool.submit(time.sleep, 600) for _ in range(2)]
    time.sleep(600)
"""


def wait_until(done: Callable[[], bool], seconds: float = 20.0) -> bool:
    deadline = time.monotonic() + seconds
    while not done() and time.monotonic() < deadline:
        time.sleep(0.05)
    return done()


def is_running(pid: int) -> bool:
    try:
        os.kill(pid, 0)
    except ProcessLookupError:
        return False
    with open(f"/proc/{pid}/stat", encoding="ascii") as stream:
        return stream.read().rpartition(")")[2].split()[0] != "Z"


@pytest.mark.skipif(not sys.platform.startswith("linux"), reason="reads /proc")
@pytest.mark.parametrize("how", ["kernel", "thread"])
@pytest.mark.parametrize("number", [signal.SIGKILL, signal.SIGTERM, signal.SIGHUP])
def test_workers_end_with_their_parent(tmp_path, how: str, number: signal.Signals) -> None:
    (tmp_path / "run.py").write_text(PARENT)
    command = [sys.executable, str(tmp_path / "run.py"), how]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True, start_new_session=True) as child:
        assert child.stdout is not None
        workers = [int(word) for word in child.stdout.readline().split()]
        assert workers and all(map(is_running, workers))
        child.send_signal(number)
        child.wait()
        assert wait_until(lambda: not any(map(is_running, workers)))
