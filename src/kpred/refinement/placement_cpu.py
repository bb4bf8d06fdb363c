"""Placing an undeformed model compiled for the CPU: rotated about the vertical, moved, sized as a whole or per axis."""

from __future__ import annotations

from typing import no_type_check

import numba
import numpy as np

from kpred.refinement.equations_cpu import FASTMATH, solve
from kpred.refinement.matching_cpu import hold, match, seen_points

YAW_PRIOR = 1e-3
"""Weight of the pull of the yaw toward 0, relative to the scan's."""

DAMPING = 1e-6
"""Weight of the step of each unknown: one that the points do not determine stays as it is."""


@numba.njit(cache=True, nogil=True)
@no_type_check
def place_rounds(
    points, start, visible, held, goal, per_axis, free_yaw, free_size, rounds, robust, minimum, placement, moved
):
    """Fill `placement` (yaw, three sizes, shift) and `moved` (N, 3) with R_yaw (size * points) + shift.

    Args:
        points: (N, 3) of the source; start: (N, 3) where the first matches are taken.
        visible: (N,) how surely each was seen; held: (N,) weight of staying at `start`; goal: (M, 3) of the scan.
        per_axis: whether the three sizes differ; free_yaw, free_size: whether yaw and sizes are unknown at all.
        robust: squared multiple of the median distance, 0 for equal weights; minimum: least squared scale.
    """
    count = points.shape[0]
    wanted = np.empty((count, 4), np.float32)
    facing = np.zeros(count, np.int64)
    seen = seen_points(visible)
    for i in range(count):
        for axis in range(3):
            moved[i, axis] = start[i, axis]
    normal, right = np.zeros((7, 7)), np.zeros(7)
    for iteration in range(rounds):
        match(moved, facing, False, goal, visible, seen, iteration % 2, robust, minimum, wanted)
        hold(wanted, held, start)
        moments = _moments(points, wanted)
        # Two steps of Gauss and Newton: the rotation is the only part that is not linear.
        for _ in range(2):
            _equations(moments, placement, normal, right)
            # The frame is likely right: a round table has no yaw of its own.
            normal[0, 0] += YAW_PRIOR
            right[0] -= YAW_PRIOR * placement[0]
            _step(normal, right, placement, per_axis, free_yaw, free_size)
        c, s = np.cos(placement[0]), np.sin(placement[0])
        for i in range(count):
            x, y, z = placement[1] * points[i, 0], placement[2] * points[i, 1], placement[3] * points[i, 2]
            moved[i, 0] = c * x + s * z + placement[4]
            moved[i, 1] = y + placement[5]
            moved[i, 2] = -s * x + c * z + placement[6]


@numba.njit(cache=True, nogil=True, fastmath=FASTMATH)
@no_type_check
def _moments(points, wanted):
    """Sum what the equations need: of weights, times coordinates and their products; of wanted places the same.

    Returns:
        w, wx, wy, wz, wxx, wyy, wzz, wxz; then u, v, q, ux, qx, vy, uz, qz of wanted places (u, v, q), which have their
        weight in them.
    """
    w = wx = wy = wz = wxx = wyy = wzz = wxz = 0.0
    u = v = q = ux = qx = vy = uz = qz = 0.0
    for i in range(len(points)):
        x, y, z = points[i, 0], points[i, 1], points[i, 2]
        a, b, c, d = wanted[i, 0], wanted[i, 1], wanted[i, 2], wanted[i, 3]
        w, wx, wy, wz = w + d, wx + d * x, wy + d * y, wz + d * z
        wxx, wyy, wzz, wxz = wxx + d * x * x, wyy + d * y * y, wzz + d * z * z, wxz + d * x * z
        u, v, q = u + a, v + b, q + c
        ux, qx, vy, uz, qz = ux + a * x, qx + c * x, vy + b * y, uz + a * z, qz + c * z
    return w, wx, wy, wz, wxx, wyy, wzz, wxz, u, v, q, ux, qx, vy, uz, qz


@numba.njit(cache=True, nogil=True)
@no_type_check
def _equations(moments, placement, normal, right):
    """Fill the lower half of `normal` (7, 7) and `right` (7,): the least squares linearised at `placement`."""
    w, wx, wy, wz, wxx, wyy, wzz, wxz, u, v, q, ux, qx, vy, uz, qz = moments
    c, s = np.cos(placement[0]), np.sin(placement[0])
    a, b, d = placement[1], placement[2], placement[3]
    tx, ty, tz = placement[4], placement[5], placement[6]
    # Sums of the rotated coordinates.
    px, pz = c * a * wx + s * d * wz, c * d * wz - s * a * wx
    normal[:] = 0.0
    normal[0, 0] = a * a * wxx + d * d * wzz
    normal[1, 0], normal[3, 0] = d * wxz, -a * wxz
    normal[1, 1], normal[2, 2], normal[3, 3] = wxx, wyy, wzz
    normal[4, 0], normal[4, 1], normal[4, 3], normal[4, 4] = pz, c * wx, s * wz, w
    normal[5, 2], normal[5, 5] = wy, w
    normal[6, 0], normal[6, 1], normal[6, 3], normal[6, 6] = -px, -s * wx, c * wz, w
    right[0] = a * (-s * ux - c * qx) + d * (c * uz - s * qz) - tx * pz + tz * px
    right[1] = c * ux - s * qx - a * wxx - (c * tx - s * tz) * wx
    right[2] = vy - b * wyy - ty * wy
    right[3] = s * uz + c * qz - d * wzz - (s * tx + c * tz) * wz
    right[4], right[5], right[6] = u - px - w * tx, v - b * wy - w * ty, q - pz - w * tz


@numba.njit(cache=True, nogil=True)
@no_type_check
def _join_sizes(normal, right, placement):
    """Make the first of three sizes the factor of all in the lower half of `normal` (7, 7) and `right` (7,)."""
    a, b, c = placement[1], placement[2], placement[3]
    right[1] = a * right[1] + b * right[2] + c * right[3]
    right[2] = right[3] = 0.0
    inner = a * a * normal[1, 1] + b * b * normal[2, 2] + c * c * normal[3, 3]
    inner += 2.0 * (a * b * normal[2, 1] + a * c * normal[3, 1] + b * c * normal[3, 2])
    normal[1, 1] = inner
    normal[1, 0] = a * normal[1, 0] + b * normal[2, 0] + c * normal[3, 0]
    for j in range(4, 7):
        normal[j, 1] = a * normal[j, 1] + b * normal[j, 2] + c * normal[j, 3]
        normal[j, 2] = normal[j, 3] = 0.0
    for j in range(2, 4):
        normal[j, j] = 1.0
        for k in range(j):
            normal[j, k] = 0.0


@numba.njit(cache=True, nogil=True)
@no_type_check
def _step(normal, right, placement, per_axis, free_yaw, free_size):
    """Add the solution of the normal equations to `placement`, with what is not free left as it is."""
    one_size = free_size and not per_axis
    if one_size:
        # One factor for all three sizes takes the place of the first of them; the other two are held at 0.
        _join_sizes(normal, right, placement)
    if not free_yaw:
        normal[0, 0] += 1e6
    for axis in range(3):
        if not free_size or (one_size and axis > 0):
            normal[1 + axis, 1 + axis] += 1e6
    for j in range(7):
        normal[j, j] += DAMPING
    solve(normal, right)
    step = right
    if one_size:
        factor = step[1]
        for axis in range(3):
            step[1 + axis] = factor * placement[1 + axis]
    placement[0] += min(max(step[0], -0.1), 0.1)
    for axis in range(3):
        placement[1 + axis] *= min(max(1.0 + step[1 + axis] / placement[1 + axis], 0.7), 1.4)
        placement[4 + axis] += step[4 + axis]
