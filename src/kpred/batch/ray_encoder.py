"""A build's batches encoded on a Ray cluster; what makes its worker die again and again is left out."""

from __future__ import annotations

import copy
import time
from collections import deque
from collections.abc import Callable, Mapping
from typing import Any

from kpred.batch.ray_cluster import RayCluster
from kpred.batch.worker import single_threaded
from kpred.database.encode import encode_prepared
from kpred.database.encoders import Batch
from kpred.database.entry import Entry
from kpred.errors import DatabaseError
from kpred.nn import KPRed
from kpred.nn.model import network_of

ATTEMPTS = 3
"""How often a batch is tried whose worker dies; then its models are tried one by one."""


MAX_WAITS = 240
"""Half seconds that a worker may take to start again."""


class RayEncoder:
    """See `kpred.database.encoders.Encoder`. Actors of one CPU each have the networks; the database stays here."""

    def __init__(self, networks: Mapping[str, KPRed], address: str, size: int | None, gpus: float = 0.0) -> None:
        """See `RayCluster`; with `gpus` the networks run on the GPU.

        Raises:
            ConfigError: Ray is not installed, no cluster is at that address, or it has too few GPUs.
        """
        self._cluster = RayCluster(address, size, gpus)
        # Shared memory of the cluster: sent once a machine, not once a worker; held, for workers that start again.
        self._networks = self._cluster.ray.put(
            {name: copy.deepcopy(network).cpu() for name, network in networks.items()}
        )
        self._actors: deque[Any] = deque(self._cluster.actors(_Encoder, "cuda" if gpus else "cpu"))
        self.max_pending = 2 * self._cluster.size

    def start(self, category: str, batch: Batch) -> Callable[[], list[Entry]]:
        """See `Encoder`; models whose worker has died every time are not among the entries.

        These raise DatabaseError where no worker starts again.
        """
        # Workers take batches in rotation, as results are taken in this order too.
        first = self._submit(category, batch)
        return lambda: self._entries(category, batch, first)

    def workers(self) -> list[int]:
        """Return the process ids of the actors."""
        return [int(pid) for pid in self._cluster.ray.get([actor.pid.remote() for actor in self._actors])]

    def close(self) -> None:
        """See `Encoder`."""
        for actor in self._actors:
            self._cluster.ray.kill(actor)
        self._cluster.close()

    def _submit(self, category: str, batch: Batch) -> Any:
        actor = self._actors[0]
        self._actors.rotate(-1)
        return actor.encode.remote([self._networks], category, batch)  # in a list it travels as a name

    def _resubmit(self, category: str, batch: Batch) -> Any:
        """Hand in to a worker that answers: one that is being started again would refuse, and that would count."""
        ray, actor = self._cluster.ray, self._actors[0]
        for _ in range(MAX_WAITS):
            try:
                ray.get(actor.pid.remote())
                return self._submit(category, batch)
            except ray.exceptions.RayError:
                time.sleep(0.5)
        raise DatabaseError(
            "A worker of the Ray cluster does not start again; look at its log, then the same command goes on."
        )

    def _entries(self, category: str, batch: Batch, reference: Any) -> list[Entry]:
        errors = self._cluster.ray.exceptions
        for attempt in range(ATTEMPTS):
            try:
                return list(self._cluster.ray.get(reference))
            except errors.RayTaskError:
                raise  # an error of the encoding itself, which would come again
            except errors.RayError:  # a dead worker, which is started again, or a lost machine
                if attempt + 1 < ATTEMPTS:
                    reference = self._resubmit(category, batch)
        if len(batch) == 1:
            return []
        return [entry for item in batch for entry in self._entries(category, [item], self._resubmit(category, [item]))]


class _Encoder:
    """What runs on the cluster."""

    def __init__(self, device: str) -> None:
        single_threaded()
        self._device = device
        self._networks: dict[str, KPRed] = {}

    def encode(self, networks: list[Any], category: str, batch: Batch) -> list[Entry]:
        import ray

        if not self._networks:  # the first batch, also of a worker that was started again
            # A copy: what lies in the cluster's memory cannot be written.
            self._networks = {k: copy.deepcopy(v).to(self._device) for k, v in ray.get(networks[0]).items()}
        network = network_of(self._networks, category)
        assert network is not None  # the build leaves other shapes out
        return encode_prepared([item for item, _ in batch], network, [meta for _, meta in batch], category)

    def pid(self) -> int:
        import os

        return os.getpid()
