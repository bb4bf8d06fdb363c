"""A limit to the time of one piece of work in the main thread of a process."""

from __future__ import annotations

import signal
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from types import FrameType

from kpred.errors import ScanError


@contextmanager
def time_limit(seconds: float | None, name: str) -> Iterator[None]:
    """Stop the work in the block after some seconds; None, or another thread than the main one, sets no limit.

    Windows has no alarm: there is no limit either. The work is stopped between two steps of Python: a single long step
    of compiled code ends first.

    Raises:
        ScanError: the time is over; the message names the scan.
    """
    if seconds is None or not hasattr(signal, "SIGALRM") or threading.current_thread() is not threading.main_thread():
        yield
        return

    def stop(_number: int, _frame: FrameType | None) -> None:
        raise ScanError(f"{name}: it took longer than {seconds:g} s and was given up (--time-limit).")

    before = signal.signal(signal.SIGALRM, stop)
    signal.setitimer(signal.ITIMER_REAL, seconds)
    try:
        yield
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0)
        signal.signal(signal.SIGALRM, before)
