"""One measured figure, how it is timed, and the machine it was measured on."""

from __future__ import annotations

import os
import platform
import statistics
import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from kpred._version import __version__


@dataclass(frozen=True)
class Figure:
    """One number beside the number of the plain path.

    Attributes:
        name: what was measured; value: in `unit`, the median of `n` runs.
        limit: the value is to be at most this (at least, where `higher_is_better`); None where none is set.
        best: the best of the runs, which varies less than the median on a busy machine.
        baseline: what the value is compared with; baseline_value: in the same unit.
        load: of the machine while it was measured (mean number of running processes of the last minute).
    """

    name: str
    value: float
    unit: str
    limit: float | None
    n: int
    best: float
    baseline: str
    baseline_value: float | None
    load: float
    higher_is_better: bool = False

    @property
    def met(self) -> bool | None:
        """Whether the value keeps its limit."""
        if self.limit is None:
            return None
        return self.value >= self.limit if self.higher_is_better else self.value <= self.limit

    @property
    def gain(self) -> float | None:
        """How many times better the value is than the baseline."""
        if not self.baseline_value or not self.value:
            return None
        ratio = self.value / self.baseline_value
        return ratio if self.higher_is_better else 1 / ratio

    def to_json(self) -> dict[str, Any]:
        """Return plain values for JSON."""
        return {**self.__dict__, "met": self.met, "gain": self.gain}


def seconds(work: Callable[[], object], repeats: int, warm: int = 1) -> list[float]:
    """Measure wall-clock seconds of `repeats` runs, after `warm` runs that are ignored."""
    for _ in range(warm):
        work()
    found = []
    for _ in range(repeats):
        started = time.perf_counter()
        work()
        found.append(time.perf_counter() - started)
    return found


def timed_figure(
    name: str,
    times: list[float],
    limit: float | None,
    baseline: str = "",
    baseline_times: list[float] | None = None,
    scale: float = 1000.0,
    unit: str = "ms",
) -> Figure:
    """Make a figure of times in seconds, by default shown in milliseconds."""
    plain = statistics.median(baseline_times) * scale if baseline_times else None
    value = statistics.median(times) * scale
    return Figure(name, value, unit, limit, len(times), min(times) * scale, baseline, plain, load())


def load() -> float:
    """Return the mean number of processes that ran or waited in the last minute."""
    return os.getloadavg()[0]


def machine(threads: int) -> dict[str, Any]:
    """Return processor, cores, memory and threads of this machine."""
    from importlib.metadata import version

    from kpred.evaluation.header import processor

    facts: dict[str, Any] = {
        "processor": processor(),
        "cores": len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count(),
        "threads": threads,
        "load_before": load(),
        "system": platform.platform(),
        "python": platform.python_version(),
        "kpred": __version__,
        **{name: version(name) for name in ("torch", "numpy", "numba", "SQLAlchemy")},
    }
    if hasattr(os, "sysconf"):
        facts["memory_gb"] = round(os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES") / 1e9, 1)
    return facts
