"""Workers of a Ray cluster: actors that load model and database once, and are started again when they die."""

from __future__ import annotations

from collections import deque
from typing import Any

from kpred.batch.ray_cluster import RayCluster
from kpred.batch.worker import BatchSettings, Outcome, fit_tasks, single_threaded
from kpred.batch.worker_pool import Group


class RayWorkerPool:
    """Actors of one CPU each, on machines that all see scans and output folder under the same paths."""

    def __init__(self, address: str, size: int | None, settings: BatchSettings, out: str, gpus: float = 0.0) -> None:
        """See `RayCluster`; with `gpus` the networks run on the GPU.

        Raises:
            ConfigError: Ray is not installed, no cluster is at that address, or it has too few GPUs.
        """
        self._cluster = RayCluster(address, size, gpus)
        self._ray = self._cluster.ray
        self.size = self._cluster.size
        self._idle: deque[Any] = deque(self._cluster.actors(_Worker, settings, out, "cuda" if gpus else "cpu"))
        self._groups: dict[Any, tuple[Group, Any]] = {}

    def start(self, group: Group) -> None:
        """See `WorkerPool`."""
        actor = self._idle[0]
        self._idle.rotate(-1)  # calls wait at their actor: the next one starts as soon as one ends
        self._groups[actor.fit.remote(group)] = (group, actor)

    def finished(self) -> list[tuple[Group, list[Outcome] | None]]:
        """See `WorkerPool`; the groups that waited at a dead actor come back with None too."""
        done, _ = self._ray.wait(list(self._groups), num_returns=1)
        found: list[tuple[Group, list[Outcome] | None]] = []
        for reference in done:
            group, _ = self._groups.pop(reference)
            try:
                found.append((group, self._ray.get(reference)))
            except self._ray.exceptions.RayError:
                found.append((group, None))
        return found

    def workers(self) -> list[int]:
        """Return the process ids of the actors."""
        return [int(pid) for pid in self._ray.get([actor.pid.remote() for actor in self._idle])]

    def close(self) -> None:
        """See `WorkerPool`."""
        for actor in self._idle:
            self._ray.kill(actor)
        self._cluster.close()


class _Worker:
    """What runs on the cluster."""

    def __init__(self, settings: BatchSettings, out: str, device: str) -> None:
        single_threaded()
        self._settings, self._out, self._device = settings, out, device

    def fit(self, group: Group) -> list[Outcome]:
        return fit_tasks(group, self._settings, self._out, self._device)

    def pid(self) -> int:
        import os

        return os.getpid()
