"""Compiled kernels shared among threads that sleep when there is nothing to do.

Numba's own parallel loops spin until all of their threads end: on a machine that has other work too, each such loop
costs a time slice, which is longer than a small kernel takes. Here the caller does its share itself, threads of a pool
do the others', and small jobs never leave the calling thread. Kernels must release the interpreter's lock.
"""

from __future__ import annotations

import itertools
import os
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor

import numba
import torch

MIN_STEPS = 2_000_000
"""Elementary steps of a kernel (some 0.3 ms) below which waking another thread takes longer than it saves."""

SLICES = 4
"""Slices for each thread."""

_pool: ThreadPoolExecutor | None = None


def thread_count() -> int:
    """Return how many threads a kernel may use: as many as torch, which follows `OMP_NUM_THREADS`.

    Numba's own number is not used: its thread pool would start, and change the number of OpenMP's threads.
    """
    return max(1, min(torch.get_num_threads(), numba.config.NUMBA_NUM_THREADS))


def parallel_for(kernel: Callable[[int, int], None], jobs: int, steps: int) -> None:
    """Run `kernel(first, last)` on slices of range(jobs), on `thread_count` threads.

    A free thread takes the next slice, so that a late thread delays no other.

    Args:
        jobs: independent of one another.
        steps: elementary steps of all jobs together, such as distances; few stay in the calling thread.
    """
    threads = min(thread_count(), jobs, max(1, 2 * steps // MIN_STEPS))
    if threads <= 1:
        kernel(0, jobs)
        return
    parts = min(jobs, SLICES * threads)
    following = itertools.count()

    def work() -> None:
        for part in following:
            if part >= parts:
                return
            kernel(jobs * part // parts, jobs * (part + 1) // parts)

    pool = _threads()
    others = [pool.submit(work) for _ in range(1, threads)]
    try:
        work()
    finally:
        # Nobody may still write into arrays that the caller is given back.
        running = [other for other in others if not other.cancel()]
        for other in running:
            other.exception()
    for other in running:
        other.result()


def _threads() -> ThreadPoolExecutor:
    global _pool
    if _pool is None:
        _pool = ThreadPoolExecutor(numba.config.NUMBA_NUM_THREADS, thread_name_prefix="kpred-kernel")
    return _pool


def _use_one_thread() -> None:
    global _pool
    _pool = None
    torch.set_num_threads(1)


# A forked child has none of its parent's threads: those of the pool must be made anew, and OpenMP would wait for its
# own for ever.
if hasattr(os, "register_at_fork"):
    os.register_at_fork(after_in_child=_use_one_thread)
