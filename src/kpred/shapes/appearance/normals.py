"""Normals and tangents of a deformed surface: each corner of a face turns and shears them as the face there does."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from kpred.ops.typing import Float, Int

_FLAT = 1e-12


@dataclass(frozen=True, eq=False)
class Corners:
    """C corners of faces: the vertices before, at and after each, and the row of the normal there."""

    before: Int[np.ndarray, " corners"]
    at: Int[np.ndarray, " corners"]
    after: Int[np.ndarray, " corners"]
    owner: Int[np.ndarray, " corners"]


def triangle_corners(faces: Int[np.ndarray, "faces 3"]) -> Corners:
    """List the corners of triangles whose vertices have a normal each."""
    flat = faces.reshape(-1)
    return Corners(faces[:, [2, 0, 1]].reshape(-1), flat, faces[:, [1, 2, 0]].reshape(-1), flat)


def deform_directions(
    corners: Corners,
    source: Float[np.ndarray, "n 3"],
    result: Float[np.ndarray, "n 3"],
    directions: Float[np.ndarray, "rows 3"],
    are_normals: bool = True,
) -> Float[np.ndarray, "rows 3"]:
    """Carry directions, unit or zero, from one shape of a surface to another; unit where they were not zero.

    Args:
        directions: in the axes of `source`; are_normals: else they are tangents, which go with the surface.
    """
    old, new = _frames(corners, source), _frames(corners, result)
    good = (np.abs(np.linalg.det(old)) > _FLAT) & (np.abs(np.linalg.det(new)) > _FLAT)
    moved = np.zeros_like(directions, dtype=np.float64)
    old, new, owner = old[good], new[good], corners.owner[good]
    mine = directions[owner]
    if are_normals:
        local = np.einsum("cji,cj->ci", old, mine)
        carried = np.einsum("cji,cj->ci", np.linalg.inv(new), local)
    else:
        carried = np.einsum("cij,cj->ci", new, np.einsum("cij,cj->ci", np.linalg.inv(old), mine))
    carried /= np.maximum(np.linalg.norm(carried, axis=1, keepdims=True), np.finfo(float).tiny)
    np.add.at(moved, owner, carried)
    lost = np.linalg.norm(moved, axis=1) < 1e-6
    if lost.any():
        centred = [points - points.mean(axis=0) for points in (source, result)]
        linear = np.linalg.lstsq(centred[0], centred[1], rcond=None)[0].T
        moved[lost] = directions[lost] @ (np.linalg.pinv(linear) if are_normals else linear.T)
    length = np.linalg.norm(moved, axis=1, keepdims=True)
    return moved / np.where(length > 0, length, 1.0)


def _frames(corners: Corners, points: np.ndarray) -> np.ndarray:
    """Return two edges and the normal of each corner as columns (C, 3, 3) of about unit length."""
    size = max(float(np.ptp(points, axis=0).max()), np.finfo(float).tiny)
    ahead = (points[corners.after] - points[corners.at]) / size
    back = (points[corners.before] - points[corners.at]) / size
    normal = np.cross(ahead, back)
    length = np.linalg.norm(normal, axis=1, keepdims=True)
    normal = normal / np.sqrt(np.maximum(length, np.finfo(float).tiny))
    return np.stack([ahead, back, normal], axis=2)
