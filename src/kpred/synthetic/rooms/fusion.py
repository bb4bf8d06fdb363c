"""Fusion of depth images: depths of one surface are averaged to one layer of points, as in a TSDF."""

from __future__ import annotations

from typing import no_type_check

import numba
import numpy as np


@numba.njit(cache=True)
@no_type_check
def back_project(measured, flying, face, owner, normals, pose, focal):
    """Turn a depth image into points.

    Args:
        measured, flying: as of `measured_depth`; face: (height, width); owner: (F,) object of each face.
        pose: (4, 4) camera to world, as tracking estimates it.

    Returns:
        (N, 3) float32 points, world; (N,) int32 objects, -1 for flying pixels; (N,) int32 code 0 to 5 of the axis and
        the side that the surface faces most.
    """
    height, width = measured.shape
    total = 0
    for i in range(height):
        for j in range(width):
            total += measured[i, j] > 0
    points = np.empty((total, 3), np.float32)
    labels = np.empty(total, np.int32)
    codes = np.empty(total, np.int32)
    at = 0
    for i in range(height):
        for j in range(width):
            z = measured[i, j]
            if z <= 0:
                continue
            x, y = (j + 0.5 - width / 2) / focal * z, (i + 0.5 - height / 2) / focal * z
            f = face[i, j]
            toward, axis = 0.0, 0
            for k in range(3):
                ray = pose[k, 0] * x + pose[k, 1] * y + pose[k, 2] * z
                points[at, k] = pose[k, 3] + ray
                toward += ray * normals[f, k]
                if abs(normals[f, k]) > abs(normals[f, axis]):
                    axis = k
            # Which side of the surface is seen, whatever the winding.
            codes[at] = 2 * axis + (1 if (normals[f, axis] > 0) == (toward < 0) else 0)
            labels[at] = -1 if flying[i, j] else owner[f]
            at += 1
    return points, labels, codes


def fused(
    points: np.ndarray, labels: np.ndarray, codes: np.ndarray, cell: float, slab: float, least: int
) -> tuple[np.ndarray, np.ndarray]:
    """Average readings of the same surface.

    Args:
        points: (N, 3) float32, metres; labels: (N,) int32; codes: (N,) int32 as of `back_project`.
        cell: side of the cells across the surface; slab: depth along its axis within which readings are one surface.
        least: readings that a point needs.

    Returns:
        (M, 3) float32 points; (M,) int32 labels.
    """
    size = 1 << int(np.ceil(np.log2(max(2 * len(points), 1024))))
    size = min(size, 1 << 22)
    return _fused(points, labels, codes, cell, slab, least, size)


@numba.njit(cache=True)
@no_type_check
def _key(x, y, z, label, code, cell, slab):
    axis = code // 2
    i = np.int64(np.floor(x / (slab if axis == 0 else cell))) + 2048
    j = np.int64(np.floor(y / (slab if axis == 1 else cell))) + 2048
    k = np.int64(np.floor(z / (slab if axis == 2 else cell))) + 2048
    return ((((i & 4095) << 12 | (j & 4095)) << 12 | (k & 4095)) << 16) | (np.int64(label + 1) << 3) | code


@numba.njit(cache=True)
@no_type_check
def _slot(keys, key):
    mask = len(keys) - 1
    at = ((key * np.int64(-7046029254386353131)) >> 20) & mask
    while keys[at] != -1 and keys[at] != key:
        at = (at + 1) & mask
    return at


@numba.njit(cache=True)
@no_type_check
def _fused(points, labels, codes, cell, slab, least, size):
    keys = np.full(size, -1, np.int64)
    sums = np.zeros((size, 3), np.float32)
    count = np.zeros(size, np.int32)
    used = 0
    for n in range(len(points)):
        key = _key(points[n, 0], points[n, 1], points[n, 2], labels[n], codes[n], cell, slab)
        at = _slot(keys, key)
        if keys[at] == -1:
            if used > 0.8 * size:
                continue
            keys[at] = key
            used += 1
        for k in range(3):
            sums[at, k] += points[n, k]
        count[at] += 1
    _join_slabs(keys, sums, count, slab)
    total = 0
    for at in range(size):
        total += count[at] >= least
    found = np.empty((total, 3), np.float32)
    label = np.empty(total, np.int32)
    row = 0
    for at in range(size):
        if count[at] >= least:
            for k in range(3):
                found[row, k] = sums[at, k] / count[at]
            label[row] = ((keys[at] >> 3) & 8191) - 1
            row += 1
    return found, label


@numba.njit(cache=True)
@no_type_check
def _join_slabs(keys, sums, count, slab):
    """Join surfaces at the border of two slabs: the smaller part joins the larger one."""
    for at in range(len(keys)):
        if keys[at] == -1 or count[at] == 0:
            continue
        axis = (keys[at] & 7) // 2
        shift = np.int64(1) << (16 + 12 * (2 - axis))
        for step in (-shift, shift):
            if count[at] == 0:
                break
            other = _slot(keys, keys[at] + step)
            if keys[other] == -1 or count[other] < count[at]:
                continue
            gap = sums[at, axis] / count[at] - sums[other, axis] / count[other]
            if abs(gap) < 0.6 * slab:
                for k in range(3):
                    sums[other, k] += sums[at, k]
                count[other] += count[at]
                count[at] = 0
