"""Compiled Chamfer distances of several clouds from one, for the CPU; one job per direction and cloud."""

from __future__ import annotations

from typing import no_type_check

import numba
import numpy as np

from kpred.ops.nearest_cpu import nearest_of_one
from kpred.ops.typing import Float
from kpred.ops.worksharing import parallel_for


def chamfer_of_each(
    target: Float[np.ndarray, "target 3"],
    results: Float[np.ndarray, "results points 3"],
    one_way: bool = False,
    step: int = 1,
    target_step: int = 1,
) -> Float[np.ndarray, " results"]:
    """Compute `chamfer_distance` (or the unilateral one) of each of `results` from one target; unit squared.

    Every `step`-th point of a result and every `target_step`-th of the target is a query; these are searched among
    all points of the other cloud, so that the distance is right in the mean.
    """
    queries = np.ascontiguousarray(target[::target_step])
    ways = 1 if one_way else 2
    means = np.zeros((len(results), ways))
    pairs = len(queries) * results.shape[1] + (ways - 1) * -(-results.shape[1] // step) * len(target)
    parallel_for(
        lambda first, last: _mean_distances(target, queries, results, step, means, first, last),
        means.size,
        len(results) * pairs // 2,
    )
    return means.sum(axis=1).astype(np.float32)


@numba.njit(cache=True, nogil=True)
@no_type_check
def _mean_distances(target, queries, results, step, means, first, last):
    ways = means.shape[1]
    for job in range(first, last):
        row, way = job // ways, job % ways
        if way == 0:
            squared, _ = nearest_of_one(queries, results[row])
        else:
            squared, _ = nearest_of_one(np.ascontiguousarray(results[row, ::step]), target)
        total = 0.0
        for value in squared:
            total += value
        means[row, way] = total / len(squared)
