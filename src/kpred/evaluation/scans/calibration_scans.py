"""Virtual scans that look like crops of real rooms, with the truth behind them: what confidence is calibrated on.

All is drawn from seed and model id alone. A fifth of the scans see the whole surface, an eighth a fragment of one
view, the others one to four depth views together. Then, each with its own chance and amount:
    missing blocks   balls of 0.15 to 0.45 around random points, in half of the scans one or two
    density          falls off with the distance from a random place, in two thirds
    noise            isotropic, standard deviation 0 to 1.5 % of half the longest side
    clutter          the part of another shape beside the object that a crop box holds, in half, up to 20 %
    floor            a strip below the object, in half, up to 25 %
    strays           0 to 2 % of the points anywhere in 1.3 times the box
Lengths are in the unit box.
"""

from __future__ import annotations

import zlib
from dataclasses import dataclass, replace

import numpy as np

from kpred.evaluation.metrics.symmetry import turned
from kpred.evaluation.scans.targets import ScanTarget, make_scan_target
from kpred.ops.typing import Float
from kpred.shapes.mesh import Mesh

WHOLE, FRAGMENT = 0.2, 0.125
MAX_VIEWS = 4
BLOCK_RADIUS = (0.15, 0.45)
NOISE = 0.015
CROP_MARGIN = 0.15
"""A crop box is so much wider than the object on each side."""

MAX_CLUTTER, MAX_FLOOR, MAX_STRAYS = 0.2, 0.25, 0.02
STRAY_BOX = 1.3
MIN_POINTS = 200


@dataclass(frozen=True, eq=False)
class CalibrationScan:
    """A scan and the truth behind it.

    Attributes:
        kind: `whole`, `views` or `fragment`; target: the truth, whose `scan` is what a fit is given.
    """

    kind: str
    target: ScanTarget


def make_calibration_scan(
    mesh: Mesh, model_id: str, neighbour: Float[np.ndarray, "points 3"], seed: int
) -> CalibrationScan:
    """Scan a mesh virtually, with what scanners and crops add and leave out.

    Args:
        neighbour: surface of another shape, unit box.

    Raises:
        MeshError: no face of the mesh has an area.
    """
    rng = np.random.default_rng([seed, zlib.crc32(model_id.encode())])
    lot = rng.random()
    kind = "whole" if lot < WHOLE else "fragment" if lot < WHOLE + FRAGMENT else "views"
    views = {"whole": 0, "fragment": 1}.get(kind) if kind != "views" else int(rng.integers(1, MAX_VIEWS + 1))
    target = make_scan_target(mesh, model_id, seed, views or 0)
    points = target.visible
    if kind == "fragment":
        distance = np.linalg.norm(points - points[rng.integers(len(points))], axis=1)
        points = points[np.argsort(distance)[: max(MIN_POINTS, int(rng.uniform(0.1, 0.45) * len(points)))]]
    points = uneven(without_blocks(points, rng), rng)
    points = points + rng.uniform(0, NOISE) * rng.standard_normal(points.shape)
    low, high = target.low - CROP_MARGIN, target.high + CROP_MARGIN
    added = [
        clutter(len(points), neighbour, target, rng),
        floor_strip(len(points), target, rng),
        rng.uniform(low, high, (int(rng.uniform(0, MAX_STRAYS) * len(points)), 3)) * STRAY_BOX,
    ]
    known = np.concatenate([points, *added])
    known = known[rng.permutation(len(known))]
    return CalibrationScan(kind, replace(target, known=known, scan=target.frame.from_unit(known)))


def without_blocks(points: Float[np.ndarray, "points 3"], rng: np.random.Generator) -> Float[np.ndarray, "left 3"]:
    """Remove no, one or two balls of points, unless too few would be left."""
    left = points
    for _ in range(int(rng.choice(3, p=(0.5, 0.25, 0.25)))):
        far = np.linalg.norm(left - left[rng.integers(len(left))], axis=1) > rng.uniform(*BLOCK_RADIUS)
        if far.sum() >= MIN_POINTS:
            left = left[far]
    return left


def uneven(points: Float[np.ndarray, "points 3"], rng: np.random.Generator) -> Float[np.ndarray, "left 3"]:
    """Thin points so that density falls with the distance from a random place, in two scans of three."""
    if rng.random() < 1 / 3:
        return points
    place = rng.uniform(-2.5, 2.5, 3)
    away = np.linalg.norm(points - place, axis=1)
    keep = rng.random(len(points)) < np.exp(-rng.uniform(0.3, 1.5) * (away - away.min()))
    return points[keep] if keep.sum() >= MIN_POINTS else points


def clutter(
    count: int, neighbour: Float[np.ndarray, "points 3"], target: ScanTarget, rng: np.random.Generator
) -> Float[np.ndarray, "clutter 3"]:
    """Place another shape beside the object, turned; what the crop box holds of it, in half of the scans."""
    if rng.random() < 0.5:
        return np.zeros((0, 3))
    piece = turned(neighbour, float(rng.uniform(0, 360)))
    axis, side = int(rng.choice((0, 2))), int(rng.choice((-1, 1)))
    reach = np.ptp(piece[:, axis]) / 2
    edge = target.high[axis] if side > 0 else -target.low[axis]
    shift = np.zeros(3)
    shift[axis] = side * (edge + reach - rng.uniform(-0.05, CROP_MARGIN))
    shift[2 - axis] = rng.uniform(-0.5, 0.5)
    shift[1] = target.low[1] - piece[:, 1].min()
    moved = piece + shift
    inside = ((moved > target.low - CROP_MARGIN) & (moved < target.high + CROP_MARGIN)).all(axis=1)
    kept: np.ndarray = moved[inside][: int(rng.uniform(0.02, MAX_CLUTTER) * count)]
    return kept


def floor_strip(count: int, target: ScanTarget, rng: np.random.Generator) -> Float[np.ndarray, "floor 3"]:
    """Sample a strip of the floor below the object, in half of the scans."""
    if rng.random() < 0.5:
        return np.zeros((0, 3))
    number = int(rng.uniform(0.03, MAX_FLOOR) * count)
    strip = rng.uniform(target.low - CROP_MARGIN, target.high + CROP_MARGIN, (number, 3))
    axis = int(rng.choice((0, 2)))
    # The strip covers a part of the box along one axis.
    begin, end = np.sort(rng.uniform(target.low[axis] - CROP_MARGIN, target.high[axis] + CROP_MARGIN, 2))
    strip[:, axis] = rng.uniform(begin, end, number)
    strip[:, 1] = target.low[1] - abs(rng.normal(0, 0.01)) + rng.normal(0, 0.005, number)
    return strip
