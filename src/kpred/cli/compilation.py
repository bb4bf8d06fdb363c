"""What commands say about compiled code: that it is being compiled, and why it cannot be cached."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from types import TracebackType
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from pathlib import Path

REPORT_AFTER = 1.0
"""Seconds of compilation after which it is reported: a single function that no fit used before is not worth a line."""

CACHING = "numba.core.caching"
"""The module of numba that writes compiled code to disk."""


@contextmanager
def reported_compilation(report: Callable[[str], None], after: float = REPORT_AFTER) -> Iterator[None]:
    """Call `report` with one line, once, when code is being compiled inside this block for `after` seconds."""
    from numba.core import event

    class Reporter(event.Listener):  # type: ignore[misc]
        started, depth, spent, reported = 0.0, 0, 0.0, False

        def on_start(self, event: Any) -> None:
            """Start the clock with the outermost function; report when enough was spent on those before."""
            if self.spent > after and not self.reported:
                self.reported = True
                report(
                    "compiling, once for this installation (about a minute of processor time); "
                    "`kpred compile` does it ahead"
                )
            self.started = time.perf_counter() if self.depth == 0 else self.started
            self.depth += 1

        def on_end(self, event: Any) -> None:
            """Stop the clock with the outermost function."""
            self.depth -= 1
            self.spent += time.perf_counter() - self.started if self.depth == 0 else 0.0

    with event.install_listener("numba:compile", Reporter()):
        yield


def cache_folder() -> Path:
    """Return the folder in which compiled code of the nearest-neighbour search is cached.

    Numba keeps the code of each package beside its source (`__pycache__`), in `NUMBA_CACHE_DIR` if that is set, or in
    `~/.cache/numba` if kpred's own folder cannot be written.
    """
    from pathlib import Path

    from kpred.ops.nearest_blocks import search_sorted

    return Path(search_sorted.stats.cache_path)


def cache_problem(error: Exception) -> str | None:
    """Describe in one sentence why compiled code cannot be cached; None for an error of another origin."""
    folder = _folder_in(error.__traceback__)
    if folder is None:
        return None
    if isinstance(error, OSError):
        return (
            f"Compiled code cannot be written to its cache {folder}: {error.strerror or error}; make room there, or "
            "name another folder with NUMBA_CACHE_DIR."
        )
    if "no locator available" in str(error):
        return (
            "Compiled code cannot be cached: neither kpred's folder nor ~/.cache can be written; name a folder with "
            "NUMBA_CACHE_DIR."
        )
    return None


def _folder_in(traceback: TracebackType | None) -> str | None:
    """Return the cache folder of the innermost frame in numba's caching; empty where it was still being searched."""
    found = None
    while traceback is not None:
        frame = traceback.tb_frame
        if frame.f_globals.get("__name__") == CACHING:
            owner = frame.f_locals.get("self")
            found = str(getattr(owner, "_cache_path", None) or getattr(owner, "cache_path", None) or found or "")
        traceback = traceback.tb_next
    return found
