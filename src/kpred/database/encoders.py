"""Who encodes the batches of a build: this process, or several with one thread each."""

from __future__ import annotations

import copy
import multiprocessing
import os
from collections.abc import Callable, Mapping
from concurrent.futures import ProcessPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from typing import Protocol, runtime_checkable

import torch

from kpred.database.encode import PreparedMesh, encode_prepared
from kpred.database.entry import Entry
from kpred.errors import DatabaseError
from kpred.nn import KPRed
from kpred.nn.model import network_of
from kpred.parent import end_with_parent

Batch = list[tuple[PreparedMesh, dict[str, str]]]
"""Meshes with their metadata."""


@runtime_checkable
class Encoder(Protocol):
    """Encodes batches, in any order; the caller takes the results in the order of `start`."""

    @property
    def max_pending(self) -> int:
        """Maximum number of unfinished batches: fewer leave workers idle, more only fill the memory."""
        ...

    def start(self, category: str, batch: Batch) -> Callable[[], list[Entry]]:
        """Hand in a batch, and get what waits for its entries."""
        ...

    def close(self) -> None:
        """Stop; what is not done is given up."""
        ...


class SerialEncoder:
    """Encodes a batch when its result is taken."""

    max_pending = 0

    def __init__(self, networks: Mapping[str, KPRed]) -> None:
        self._networks = dict(networks)

    def start(self, category: str, batch: Batch) -> Callable[[], list[Entry]]:
        """See `Encoder`."""
        return lambda: _encode(self._networks, category, batch)

    def close(self) -> None:
        """See `Encoder`."""


class ProcessEncoder:
    """Encodes batches in processes that have the networks."""

    def __init__(self, networks: Mapping[str, KPRed], workers: int) -> None:
        self.max_pending = 2 * workers
        self._pool = ProcessPoolExecutor(
            workers,
            # Fresh interpreters: a forked one would share locks of torch's threads.
            mp_context=multiprocessing.get_context("spawn"),
            initializer=_init_worker,
            initargs=(
                os.getpid(),
                {name: copy.deepcopy(network).cpu() for name, network in networks.items()},
            ),
        )

    def start(self, category: str, batch: Batch) -> Callable[[], list[Entry]]:
        """See `Encoder`. Raises DatabaseError when a process has died."""

        def entries() -> list[Entry]:
            with _translate_errors():
                return future.result()

        with _translate_errors():
            future = self._pool.submit(_encode_in_worker, category, batch)
        return entries

    def close(self) -> None:
        """See `Encoder`."""
        self._pool.shutdown(wait=True, cancel_futures=True)


class _translate_errors:
    """A dead process as an error that says how to go on."""

    def __enter__(self) -> None:
        return None

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, trace: object) -> None:
        if isinstance(error, BrokenProcessPool):
            raise DatabaseError(
                "A process that encoded models died (out of memory?); the same command goes on, with fewer --workers."
            ) from error


_networks: dict[str, KPRed] = {}


def _init_worker(parent: int, networks: dict[str, KPRed]) -> None:
    end_with_parent(parent)
    torch.set_num_threads(1)
    _networks.update(networks)


def _encode_in_worker(category: str, batch: Batch) -> list[Entry]:
    return _encode(_networks, category, batch)


def _encode(networks: Mapping[str, KPRed], category: str, batch: Batch) -> list[Entry]:
    network = network_of(networks, category)
    assert network is not None  # the build leaves other shapes out
    return encode_prepared([item for item, _ in batch], network, [meta for _, meta in batch], category)
