"""Workers of a Ray cluster: actors that load model and database once, and are started again when they die."""

from __future__ import annotations

from collections import deque
from typing import Any

from kpred.batch.task import Task
from kpred.batch.worker import BatchSettings, Outcome, fit_task, single_threaded
from kpred.errors import ConfigError


class RayCrew:
    """Actors of one CPU each, on machines that all see scans and output folder under the same paths."""

    def __init__(self, address: str, size: int | None, settings: BatchSettings, out: str) -> None:
        """`address`: `auto`, `local` (a cluster of its own on this machine) or the head's address; `size`: number of
        actors, None for one a CPU of the cluster.

        Raises:
            ConfigError: Ray is not installed, or no cluster is at that address.
        """
        try:
            import ray
        except ImportError as error:
            raise ConfigError("Fitting on a cluster needs Ray; pip install 'kpred[ray]'.") from error
        self._ray: Any = ray
        self._begun = not ray.is_initialized()
        try:
            if self._begun:
                options = {"num_cpus": size, "include_dashboard": False} if address == "local" else {}
                ray.init(address=address, logging_level="error", log_to_driver=False, **options)
        except (ConnectionError, ValueError, RuntimeError, TimeoutError) as error:
            reason = str(error).splitlines()[0] if str(error) else type(error).__name__
            raise ConfigError(
                f"No Ray cluster was found at {address!r} ({reason}); start one, or give its address."
            ) from error
        self.size = size or max(1, int(ray.cluster_resources().get("CPU", 1)))
        kind = ray.remote(num_cpus=1, max_restarts=-1)(_Worker)
        self._idle: deque[Any] = deque(kind.remote(settings, out) for _ in range(self.size))
        self._tasks: dict[Any, tuple[Task, Any]] = {}

    def start(self, task: Task) -> None:
        """See `Crew`."""
        actor = self._idle[0]
        self._idle.rotate(-1)  # calls wait at their actor: the next one starts as soon as one ends
        self._tasks[actor.fit.remote(task)] = (task, actor)

    def finished(self) -> list[tuple[Task, Outcome | None]]:
        """See `Crew`; the tasks that waited at a dead actor come back with None too."""
        done, _ = self._ray.wait(list(self._tasks), num_returns=1)
        found: list[tuple[Task, Outcome | None]] = []
        for reference in done:
            task, _ = self._tasks.pop(reference)
            try:
                found.append((task, self._ray.get(reference)))
            except self._ray.exceptions.RayError:
                found.append((task, None))
        return found

    def workers(self) -> list[int]:
        """Process ids of the actors."""
        return [int(pid) for pid in self._ray.get([actor.pid.remote() for actor in self._idle])]

    def close(self) -> None:
        """See `Crew`."""
        for actor in self._idle:
            self._ray.kill(actor)
        if self._begun:
            self._ray.shutdown()


class _Worker:
    """What runs on the cluster."""

    def __init__(self, settings: BatchSettings, out: str) -> None:
        single_threaded()
        self._settings, self._out = settings, out

    def fit(self, task: Task) -> Outcome:
        return fit_task(task, self._settings, self._out)

    def pid(self) -> int:
        import os

        return os.getpid()
