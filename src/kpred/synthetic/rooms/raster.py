"""Depth images of triangle meshes by a z-buffer, compiled; and which places the cameras of images see."""

from __future__ import annotations

from typing import no_type_check

import numba
import numpy as np

NEAR = 0.05
"""Surfaces nearer than this (metres along the viewing axis) are cut away."""


@numba.njit(cache=True, fastmath=False)
@no_type_check
def render_frame(vertices, faces, pose, focal, width, height):
    """Render the depth and the face of each pixel's centre.

    Args:
        vertices: (V, 3) float32, world, metres; faces: (F, 3) int32, seen from both sides.
        pose: (4, 4) camera to world; the camera looks along +z, x is right, y is down.
        focal: focal length in pixels; the principal point is the middle of the image.

    Returns:
        (height, width) float32 depth along the viewing axis, 0 where nothing is seen; (height, width) int32 face, -1
        for none.
    """
    local = np.empty((len(vertices), 3), np.float32)
    for n in range(len(vertices)):
        x = vertices[n, 0] - pose[0, 3]
        y = vertices[n, 1] - pose[1, 3]
        z = vertices[n, 2] - pose[2, 3]
        for k in range(3):
            local[n, k] = pose[0, k] * x + pose[1, k] * y + pose[2, k] * z
    inverse = np.zeros((height, width), np.float32)
    owner = np.full((height, width), -1, np.int32)
    corners = np.empty((4, 3), np.float64)
    plane = np.empty((4, 3), np.float64)
    for f in range(len(faces)):
        count = _clipped(local, faces[f], corners)
        if count < 3:
            continue
        for n in range(count):
            plane[n, 2] = 1.0 / corners[n, 2]
            plane[n, 0] = corners[n, 0] * plane[n, 2] * focal + width / 2 - 0.5
            plane[n, 1] = corners[n, 1] * plane[n, 2] * focal + height / 2 - 0.5
        for n in range(1, count - 1):
            _draw(plane[0], plane[n], plane[n + 1], f, inverse, owner)
    depth = np.zeros((height, width), np.float32)
    for i in range(height):
        for j in range(width):
            if inverse[i, j] > 0:
                depth[i, j] = 1.0 / inverse[i, j]
    return depth, owner


@numba.njit(cache=True)
@no_type_check
def _clipped(local, face, corners):
    """Clip a triangle at the near plane; return how many of `corners` (4, 3) hold the polygon."""
    count = 0
    for n in range(3):
        a, b = face[n], face[(n + 1) % 3]
        za, zb = local[a, 2], local[b, 2]
        if za > NEAR:
            for k in range(3):
                corners[count, k] = local[a, k]
            count += 1
        if (za > NEAR) != (zb > NEAR):
            t = (NEAR - za) / (zb - za)
            for k in range(3):
                corners[count, k] = local[a, k] + t * (local[b, k] - local[a, k])
            count += 1
    return count


@numba.njit(cache=True)
@no_type_check
def _draw(a, b, c, face, inverse, owner):
    """Draw a projected triangle of corners (u, v, inverse depth); inverse depth is linear over it."""
    height, width = inverse.shape
    top = max(0, int(np.ceil(min(a[1], b[1], c[1]))))
    bottom = min(height - 1, int(np.floor(max(a[1], b[1], c[1]))))
    left = max(0, int(np.ceil(min(a[0], b[0], c[0]))))
    right = min(width - 1, int(np.floor(max(a[0], b[0], c[0]))))
    if top > bottom or left > right:
        return
    area = (b[0] - a[0]) * (c[1] - a[1]) - (c[0] - a[0]) * (b[1] - a[1])
    if area == 0:
        return
    scale = 1.0 / area
    # Barycentric weights of b and c are linear in the pixel's place.
    wb_u, wb_v = (c[1] - a[1]) * scale, -(c[0] - a[0]) * scale
    wc_u, wc_v = -(b[1] - a[1]) * scale, (b[0] - a[0]) * scale
    for i in range(top, bottom + 1):
        wb = wb_u * (left - a[0]) + wb_v * (i - a[1])
        wc = wc_u * (left - a[0]) + wc_v * (i - a[1])
        for j in range(left, right + 1):
            if wb >= -1e-9 and wc >= -1e-9 and wb + wc <= 1 + 1e-9:
                value = a[2] + wb * (b[2] - a[2]) + wc * (c[2] - a[2])
                if value > inverse[i, j]:
                    inverse[i, j] = value
                    owner[i, j] = face
            wb += wb_u
            wc += wc_u


@numba.njit(cache=True)
@no_type_check
def count_views(places, poses, focal, depths, tolerance, near, far, empty_sees):
    """Count the images that would show surface at places, and those that look through them.

    Args:
        places: (N, 3) world, metres; poses: (K, 4, 4) camera to world.
        depths: (K, height, width) metres, 0 where nothing is.
        tolerance: (N,) how far a place may lie behind what is seen and still counts as seen, metres.
        near, far: range of the sensor, metres.
        empty_sees: whether a pixel where nothing is sees all places before it, or is left out.

    Returns:
        (N,) int32: images that see the place; (N,) int32: images that see farther than the place by its tolerance.
    """
    height, width = depths.shape[1], depths.shape[2]
    seen = np.zeros(len(places), np.int32)
    through = np.zeros(len(places), np.int32)
    for n in range(len(places)):
        for k in range(len(poses)):
            x = places[n, 0] - poses[k, 0, 3]
            y = places[n, 1] - poses[k, 1, 3]
            z = places[n, 2] - poses[k, 2, 3]
            depth = poses[k, 0, 2] * x + poses[k, 1, 2] * y + poses[k, 2, 2] * z
            if depth < near or depth > far:
                continue
            u = (poses[k, 0, 0] * x + poses[k, 1, 0] * y + poses[k, 2, 0] * z) / depth * focal + width / 2
            v = (poses[k, 0, 1] * x + poses[k, 1, 1] * y + poses[k, 2, 1] * z) / depth * focal + height / 2
            if u < 0 or v < 0 or u >= width or v >= height:
                continue
            surface = depths[k, int(v), int(u)]
            if (surface == 0 and empty_sees) or (surface > 0 and depth <= surface + tolerance[n]):
                seen[n] += 1
            if surface > 0 and depth < surface - tolerance[n]:
                through[n] += 1
    return seen, through
