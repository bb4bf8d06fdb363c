"""Compiled kernels shared among threads that sleep when there is nothing to do.

Numba's own parallel loops wait busily for all of their threads: on a machine that has other work too, each such loop
costs a time slice, which is longer than a small kernel takes. Here the caller does its share itself, threads of a pool
do the others', and small jobs never leave the calling thread. Kernels must release the interpreter's lock.
"""

from __future__ import annotations

import os
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor

import numba

WORTH = 2_000_000
"""Elementary steps of a kernel (some 0.3 ms) below which waking another thread takes longer than it saves."""

_pool: ThreadPoolExecutor | None = None


def share_out(kernel: Callable[[int, int], None], jobs: int, steps: int) -> None:
    """`kernel(first, last)` for slices that make up range(jobs), on as many threads as numba is set to use.

    Args:
        jobs: independent of one another, of about equal work.
        steps: elementary steps of all jobs together, such as distances; few stay in the calling thread.
    """
    threads = min(numba.get_num_threads(), jobs, max(1, 2 * steps // WORTH))
    if threads <= 1:
        kernel(0, jobs)
        return
    limits = [jobs * part // threads for part in range(threads + 1)]
    others = [_threads().submit(kernel, limits[part], limits[part + 1]) for part in range(1, threads)]
    try:
        kernel(0, limits[1])
    finally:
        # Nobody may still write into arrays that the caller is given back.
        for other in others:
            other.exception()
    for other in others:
        other.result()


def _threads() -> ThreadPoolExecutor:
    global _pool
    if _pool is None:
        _pool = ThreadPoolExecutor(numba.config.NUMBA_NUM_THREADS, thread_name_prefix="kpred-kernel")
    return _pool


def _forget() -> None:
    global _pool
    _pool = None


# A forked child has none of its parent's threads.
if hasattr(os, "register_at_fork"):
    os.register_at_fork(after_in_child=_forget)
