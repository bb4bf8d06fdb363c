"""How a command is stopped: Ctrl-C, SIGTERM and SIGHUP all end it in order, with its workers and unfinished files."""

from __future__ import annotations

import signal
import sys
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from types import FrameType

_SIGNALS = [getattr(signal, name) for name in ("SIGTERM", "SIGHUP") if hasattr(signal, name)]


class Stopped(KeyboardInterrupt):
    """A signal other than that of Ctrl-C stopped the command; what handles Ctrl-C handles it too."""

    def __init__(self, number: int) -> None:
        super().__init__()
        self.number = number


@contextmanager
def stopped_by_signals() -> Iterator[None]:
    """Raise `Stopped` in the main thread when SIGTERM or SIGHUP comes, unless it is ignored, as under nohup."""
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    before = {number: signal.getsignal(number) for number in _SIGNALS}
    taken = [number for number, handler in before.items() if handler is signal.SIG_DFL]
    for number in taken:
        signal.signal(number, _stop)
    try:
        yield
    finally:
        for number in taken:
            signal.signal(number, before[number])


@contextmanager
def resumable(message: str, kept: Callable[[], bool] = lambda: True) -> Iterator[None]:
    """Add to an interruption what is kept and how to go on; `kept`: whether there is anything by then."""
    try:
        yield
    except KeyboardInterrupt as error:
        if kept():
            error.args = (message,)
        raise


def report_stop(error: KeyboardInterrupt) -> int:
    """Print what stopped the command, and what can be done now, and return its exit code: 128 and the signal."""
    cause = _cause(error)
    name = "Ctrl-C" if cause is None else signal.Signals(cause.number).name
    # The cause has no words of its own; who handled it may have added some.
    words = f"; {error}" if error.args else ""
    print(f"kpred: stopped by {name}{words}", file=sys.stderr)
    return 128 + (signal.SIGINT if cause is None else cause.number)


def _stop(number: int, frame: FrameType | None) -> None:
    raise Stopped(number)


def _cause(error: BaseException | None) -> Stopped | None:
    """Find the signal behind an interruption that was raised again with words."""
    while error is not None and not isinstance(error, Stopped):
        error = error.__cause__
    return error
