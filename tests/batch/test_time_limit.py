import signal
import threading
import time

import pytest

from kpred.batch.time_limit import time_limit
from kpred.errors import ScanError


def busy(seconds: float) -> None:
    end = time.monotonic() + seconds
    while time.monotonic() < end:
        pass


def test_work_that_takes_too_long_is_stopped_and_other_work_is_not() -> None:
    before = signal.getsignal(signal.SIGALRM)
    with pytest.raises(ScanError, match=r"a\.ply: it took longer than 0\.05 s"), time_limit(0.05, "a.ply"):
        busy(30)
    with time_limit(30.0, "a.ply"):
        busy(0.01)
    with time_limit(None, "a.ply"):
        busy(0.01)
    assert signal.getsignal(signal.SIGALRM) is before
    assert signal.getitimer(signal.ITIMER_REAL) == (0.0, 0.0)


def test_in_other_threads_there_is_no_limit() -> None:
    done = []

    def work() -> None:
        with time_limit(0.01, "a.ply"):
            busy(0.05)
            done.append(True)

    thread = threading.Thread(target=work)
    thread.start()
    thread.join()
    assert done == [True]
