"""Compiled for the CPU: 8-bit codes of tokens, and bounds of the weighted L1 distance from them.

Bounds take one pass, model by model. Codes lie in planes of a few keypoints each, model after model within a plane. Of
a model that is already farther than the k-th best so far, the remaining planes are not read: the pass is bound by
memory, and most models go early. Sums of absolute differences are written as vector operations that compilers know as
one instruction (psadbw on x86). `kpred.database.token_codes.bounds_reference` is the plain version that a test holds it
to.
"""

from __future__ import annotations

import itertools
from typing import Any, no_type_check

import numba
import numpy as np
from llvmlite import ir
from numba.core import cgutils, types
from numba.extending import intrinsic

from kpred.ops.worksharing import SLICES, parallel_for, thread_count

LANES = 64
"""Bytes compared at once; tokens are padded to whole multiples of it."""

BLOCK = 256
"""Models of one job: the codes of one plane of them lie in the second-level cache."""


@intrinsic
@no_type_check
def _absolute_differences(context, a, i, b, j):
    """Sum |a[i + n] - b[j + n]| over 64 bytes of two contiguous uint8 arrays, unchecked."""

    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        narrow, wide = ir.VectorType(ir.IntType(8), LANES), ir.VectorType(ir.IntType(32), LANES)

        def load(kind: Any, array: Any, at: Any) -> Any:
            data = context.make_array(kind)(context, builder, array).data
            loaded = builder.load(builder.bitcast(builder.gep(data, [at]), narrow.as_pointer()))
            loaded.align = 1
            return loaded

        def call(name: str, result: Any, *values: Any) -> Any:
            kind = ir.FunctionType(result, [value.type for value in values])
            return builder.call(cgutils.get_or_insert_function(builder.module, kind, name), values)

        x, y = load(a, arguments[0], arguments[1]), load(b, arguments[2], arguments[3])
        high, low = call("llvm.umax.v64i8", narrow, x, y), call("llvm.umin.v64i8", narrow, x, y)
        total = call("llvm.vector.reduce.add.v64i32", ir.IntType(32), builder.zext(builder.sub(high, low), wide))
        return builder.zext(total, ir.IntType(64))

    return types.int64(a, types.intp, b, types.intp), generate


@numba.njit(cache=True, nogil=True)
@no_type_check
def _keypoint_sum(codes, start, query, at, size):
    total = 0
    for byte in range(0, size, LANES):
        total += _absolute_differences(codes, start + byte, query, at + byte)
    return total


@numba.njit(cache=True, nogil=True)
@no_type_check
def _keep(heap, value):
    """Put a value into the place of the largest of `heap` and return the largest after that."""
    worst = 0
    for i in range(1, len(heap)):
        if heap[i] > heap[worst]:
            worst = i
    heap[worst] = value
    largest = heap[0]
    for i in range(1, len(heap)):
        largest = max(largest, heap[i])
    return largest


@numba.njit(cache=True, nogil=True)
@no_type_check
def _bounds(codes, errors, query, order, step, unit, outside, slack, heap, limits, slot, lower, start, end):
    planes, group, size = query.shape
    flat = query.reshape(planes * group * size)
    count = len(lower)
    for block in range(start, end):
        first = block * BLOCK
        alive = min(BLOCK, count - first)
        rows = np.empty(BLOCK, np.int64)
        low = np.zeros(BLOCK)
        high = np.zeros(BLOCK)
        for i in range(alive):
            rows[i] = first + i
            lower[first + i] = np.inf
        limit = limits.min()
        for p in range(planes):
            plane = order[p]
            kept = 0
            for i in range(alive):
                at = plane * count + rows[i]
                a, b = low[i], high[i]
                for k in range(group):
                    total = _keypoint_sum(codes, (at * group + k) * size, flat, (plane * group + k) * size, size)
                    middle = step[plane, k] * total + outside[plane, k]
                    error = unit[plane, k] * errors[at * group + k] + slack[plane, k]
                    a += max(middle - error, 0.0)
                    b += middle + error
                if a <= limit:
                    rows[kept], low[kept], high[kept] = rows[i], a, b
                    kept += 1
            alive = kept
            if alive == 0:
                break
        for i in range(alive):
            lower[rows[i]] = low[i]
            if high[i] < limits[slot]:
                limits[slot] = _keep(heap, high[i])


def bounds_cpu(
    codes: np.ndarray,
    errors: np.ndarray,
    query: np.ndarray,
    order: np.ndarray,
    factors: tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray],
    top_k: int,
    lower: np.ndarray,
) -> float:
    """Compute lower bounds of M distances, and an upper bound of the `top_k` smallest.

    G planes of P keypoints, each of S bytes.

    Args:
        codes: (G * M * P * S,) uint8; errors: (G * M * P,) uint8.
        query: (G, P, S) uint8; order: (G,) in which planes are read.
        factors: (G, P) float64 each, weights included: distance per step of the codes, error per unit of `errors`,
            distance of the query from the codes' range, error of the query's own codes.
        lower: (M,) float32, filled with the bounds; infinity where the pass gave a model up.
    """
    blocks = (len(lower) + BLOCK - 1) // BLOCK
    slots = SLICES * thread_count()
    heaps = np.full((slots, top_k), np.inf)
    free = itertools.count()
    # A slice uses the limits that the others have found so far.
    limits = np.full(slots, np.inf)

    def some(first: int, last: int) -> None:
        slot = next(free)
        _bounds(codes, errors, query, order, *factors, heaps[slot], limits, slot, lower, first, last)

    parallel_for(some, blocks, len(lower) * query.size)
    return float(np.partition(heaps.ravel(), top_k - 1)[top_k - 1])


@numba.njit(cache=True, nogil=True)
@no_type_check
def _encode(tokens, lowest, step, unit, codes, errors, first, last):
    _, keypoints, size = tokens.shape
    for i in range(first, last):
        for k in range(keypoints):
            missed = 0.0
            for c in range(size):
                scaled = (np.float64(tokens[i, k, c]) - lowest[k, c]) / step[k]
                code = min(max(np.rint(scaled), 0.0), 255.0)
                missed += abs(scaled - code)
                codes[i, k, c] = np.uint8(code)
            errors[i, k] = np.uint8(min(np.ceil(missed * step[k] / unit[k]), 255.0))


def encode_cpu(
    tokens: np.ndarray, lowest: np.ndarray, step: np.ndarray, unit: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Quantise (M, K, C) float32 to codes (M, K, C) and errors (M, K), uint8."""
    codes = np.empty(tokens.shape, np.uint8)
    errors = np.empty(tokens.shape[:2], np.uint8)
    arrays = np.ascontiguousarray(tokens, dtype=np.float32), lowest, step, unit, codes, errors
    parallel_for(lambda first, last: _encode(*arrays, first, last), len(tokens), 4 * tokens.size)
    return codes, errors
