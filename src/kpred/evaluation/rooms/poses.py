"""True poses of the furniture of virtual rooms, and which of them results meet (Scan2CAD's criterion)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.spatial import cKDTree

from kpred.fitting.object_fit import ObjectFit
from kpred.ops.rotations import yaw_rotation
from kpred.ops.typing import Float
from kpred.synthetic.rooms.pack import UNIT, RoomPack

MAX_DISTANCE, MAX_ANGLE, MAX_SCALE = 0.2, np.radians(20.0), 0.2
"""Metres between middles, angle between fronts, and mean relative error of the sides: Avetisyan et al., CVPR 2019."""

ORDERS = (12, 4, 2)
"""Orders of symmetry about the up axis that are looked for; from the first on, a thing is round."""

SAME = 1.35
"""A surface is as before a turn if its points are, in the mean, no farther from it than this many times its spacing."""


@dataclass(frozen=True, eq=False)
class TruePose:
    """Where a piece of furniture stands, z up, metres.

    Attributes:
        row: of the object in its room; category: chair, table or cabinet.
        middle: (3,) of its whole box; size: (3,) its width, height and depth; front: (3,) where it looks.
        order: number of yaws at which it looks the same.
    """

    row: int
    category: str
    middle: Float[np.ndarray, "3"]
    size: Float[np.ndarray, "3"]
    front: Float[np.ndarray, "3"]
    order: int


def true_poses(
    pack: RoomPack, objects: slice, turn: Float[np.ndarray, "3 3"], categories: Sequence[str]
) -> tuple[TruePose, ...]:
    """List the poses of a room's furniture; `turn` is the rotation (3, 3) from the pack's room to z up."""
    found = []
    for row in range(objects.stop - objects.start):
        name, surface = str(pack.category[objects][row]), int(pack.surface_row[objects][row])
        if name not in categories or surface < 0:
            continue
        pose, box = pack.pose[objects][row].astype(np.float64), pack.box[objects][row].astype(np.float64)
        middle = pose[:3, :3] @ box.mean(axis=0) + pose[:3, 3]
        order = symmetry_order(pack.surface[surface].astype(np.float64) * UNIT - box.mean(axis=0))
        found.append(TruePose(row, name, turn @ middle, np.ptp(box, axis=0), turn @ pose[:3, 2], order))
    return tuple(found)


def symmetry_order(points: Float[np.ndarray, "points 3"]) -> int:
    """Return the number of yaws at which a surface (N, 3), y up, centred, looks the same."""
    half = len(points) // 2
    tree = cKDTree(points[:half])
    spacing = float(tree.query(points[half:])[0].mean())
    for order in ORDERS:
        turned = points[half:] @ yaw_rotation(2 * np.pi / order).T
        if float(tree.query(turned)[0].mean()) <= SAME * spacing:
            return order
    return 1


def aligned_rows(poses: Sequence[TruePose], fits: Sequence[ObjectFit]) -> set[int]:
    """Return rows of the true objects that a result meets; each result meets one at most, the surest first.

    A result meets an object of its category within `MAX_DISTANCE`, `MAX_ANGLE`, up to symmetry, and `MAX_SCALE`.
    """
    met: set[int] = set()
    for item in sorted((one for one in fits if one.fit is not None), key=_doubt):
        near = [pose for pose in poses if pose.row not in met and _meets(item, pose)]
        if near:
            middle = item.cad_to_scan()[:3, 3]
            met.add(min(near, key=lambda pose: float(np.linalg.norm(pose.middle - middle))).row)
    return met


def _doubt(item: ObjectFit) -> float:
    assert item.fit is not None
    return -item.fit.confidence * (1.0 if item.object.score is None else item.object.score)


def _meets(item: ObjectFit, pose: TruePose) -> bool:
    assert item.fit is not None
    if item.fit.category != pose.category:
        return False
    matrix = item.cad_to_scan()
    size = np.ptp(np.asarray(item.cad_mesh().vertices), axis=0) * np.linalg.norm(matrix[:3, :3], axis=0)
    if np.linalg.norm(matrix[:3, 3] - pose.middle) > MAX_DISTANCE:
        return False
    if abs(float((size / pose.size).mean()) - 1.0) > MAX_SCALE:
        return False
    front = item.fit.frame.rotation[2]
    tilt = float(np.arccos(np.clip(item.fit.up[2], -1.0, 1.0)))
    yaw = float(np.arctan2(front[1], front[0]) - np.arctan2(pose.front[1], pose.front[0]))
    period = 2 * np.pi / pose.order if pose.order < ORDERS[0] else 0.0
    off = 0.0 if period == 0.0 else abs((yaw + period / 2) % period - period / 2)
    return bool(np.hypot(off, tilt) <= MAX_ANGLE)
