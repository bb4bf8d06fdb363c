"""Worker processes end with the process that started them, however that one ends."""

from __future__ import annotations

import ctypes
import os
import signal
import sys
import threading
import time

_PR_SET_PDEATHSIG = 1

POLL_SECONDS = 1.0
"""Between two looks at the parent, where the system cannot send a signal."""


def end_with_parent(parent: int) -> None:
    """Let this process be killed when the process `parent`, which started it, is gone.

    On Linux the kernel sends the signal; elsewhere a thread looks for the parent every second.
    """
    if not _request_signal():
        threading.Thread(target=_watch, args=(parent,), name="kpred-parent", daemon=True).start()
    if os.getppid() != parent:  # It ended before the request to the kernel.
        os._exit(1)


def _request_signal() -> bool:
    """Request SIGKILL at the parent's end from Linux, and return whether it will be sent."""
    if not sys.platform.startswith("linux"):
        return False
    try:
        return ctypes.CDLL(None, use_errno=True).prctl(_PR_SET_PDEATHSIG, signal.SIGKILL, 0, 0, 0) == 0
    except (OSError, AttributeError):
        return False


def _watch(parent: int) -> None:
    while os.getppid() == parent:
        time.sleep(POLL_SECONDS)
    os._exit(1)
