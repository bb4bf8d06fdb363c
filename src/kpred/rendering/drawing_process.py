"""A process that stays and draws view after view, for programs that draw often: starting one takes over a second."""

from __future__ import annotations

import os
import selectors
import subprocess
import sys
from pathlib import Path

_MAX_VIEWS = 200
"""After which it is replaced: graphics libraries leak."""


class DrawingProcess:
    """The process of `draw_pyvista.py`, started at first use and after every failure."""

    def __init__(self) -> None:
        self._process: subprocess.Popen[bytes] | None = None
        self._drawn = 0

    def draw(self, file: Path, picture: Path, seconds: float) -> bool:
        """Draw the arrays of a file to a picture; False if that failed or took longer."""
        if self._drawn >= _MAX_VIEWS:
            self.stop()
        process = self._process or self._start()
        assert process.stdin is not None and process.stdout is not None
        try:
            process.stdin.write(os.fsencode(file) + b"\t" + os.fsencode(picture) + b"\n")
            process.stdin.flush()
        except OSError:
            self.stop()
            return False
        self._drawn += 1
        with selectors.DefaultSelector() as selector:
            selector.register(process.stdout, selectors.EVENT_READ)
            done = bool(selector.select(seconds)) and process.stdout.readline() == b"done\n"
        if not done:
            self.stop()
        return done and picture.is_file() and picture.stat().st_size > 0

    def stop(self) -> None:
        """End the process."""
        if self._process is not None:
            self._process.kill()
            self._process.communicate()
        self._process, self._drawn = None, 0

    def _start(self) -> subprocess.Popen[bytes]:
        # By path and not as a module: the other process then loads nothing of kpred, and no torch.
        script = Path(__file__).with_name("draw_pyvista.py")
        self._process = subprocess.Popen(
            [sys.executable, "-P", str(script)],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.DEVNULL,
        )
        return self._process


_kept: list[DrawingProcess] = []


def keep_drawing_process() -> None:
    """Let one process draw all pictures of this program from now on; it ends with the program."""
    if not _kept:
        _kept.append(DrawingProcess())


def kept_drawing_process() -> DrawingProcess | None:
    """Return the process that stays, if there is one."""
    return _kept[0] if _kept else None
