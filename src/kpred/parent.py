"""Worker processes end with the process that started them, however that one ends."""

from __future__ import annotations

import ctypes
import os
import signal
import sys
import threading
import time

_PR_SET_PDEATHSIG = 1
_SYNCHRONIZE, _FOR_EVER = 0x00100000, 0xFFFFFFFF
"""Constants of Linux and of Windows."""

POLL_SECONDS = 1.0
"""Between two looks at the parent, where the system cannot send a signal."""


def end_with_parent(parent: int) -> None:
    """Let this process be killed when the process `parent`, which started it, is gone.

    On Linux the kernel sends the signal. On macOS a thread looks for the parent every second. On Windows it waits for
    the parent's end, since a process keeps the number of a parent that is gone.
    """
    if sys.platform == "win32":
        threading.Thread(target=_wait, args=(parent,), name="kpred-parent", daemon=True).start()
        return
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


def _wait(parent: int) -> None:
    """Wait for the end of a process on Windows."""
    if sys.platform == "win32":
        kernel = ctypes.WinDLL("kernel32", use_last_error=True)
        kernel.OpenProcess.restype = ctypes.c_void_p
        handle = kernel.OpenProcess(_SYNCHRONIZE, False, parent)
        if handle:
            kernel.WaitForSingleObject(ctypes.c_void_p(handle), _FOR_EVER)
    os._exit(1)


def _watch(parent: int) -> None:
    while os.getppid() == parent:
        time.sleep(POLL_SECONDS)
    os._exit(1)
