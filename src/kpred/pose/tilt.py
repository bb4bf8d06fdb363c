"""Tilt of a camera without a pose: the angle by which it looks down, from the object in its view."""

from __future__ import annotations

import numpy as np

from kpred.nn import Recognizer
from kpred.ops.rotations import upright_rotation, yaw_rotation
from kpred.ops.typing import Float
from kpred.pose.recognition import predict_logits
from kpred.preprocessing.normals import estimate_normals

COARSE_DEGREES = tuple(range(0, 71, 10))
COARSE_POINTS, FINE_POINTS = 128, 384
"""Tilts are compared with few points first; around the best ones, with more."""

MAX_REFINED = 3
FINE_STEP = 5.0

YAWS = tuple(yaw_rotation(yaw) for yaw in np.radians(np.arange(0, 360, 30)))

MIN_GAIN, MIN_FLAT_GAIN = 3.0, 0.5
"""Log-odds by which a tilted camera must be likelier than a level one, and where level surfaces say the same."""

FLAT_POINTS, FLAT_NEIGHBOURS = 1024, 16
FLAT_ANGLE = 15.0
MIN_FLAT = 0.08
"""Points by whose normals a tilt is corrected, degrees by which level surfaces may lean then, and the fraction of all
points that must lie on such surfaces.
"""

MIN_TILT = 4.0
"""Degrees below which a camera is taken to look level."""


def find_tilt(points: Float[np.ndarray, "points 3"], recognizer: Recognizer) -> float:
    """Estimate the angle (radians) by which a camera looks down; 0 if it looks level or nothing speaks against that.

    Args:
        points: (N, 3) of one object in the camera's axes (x right, y down, z forward), in random order, any unit.
    """
    coarse = np.radians(np.array(COARSE_DEGREES, dtype=np.float64))
    odds = _odds(points[:COARSE_POINTS], coarse, recognizer)
    around = coarse[np.argsort(-odds)[:MAX_REFINED]]
    steps = np.radians(FINE_STEP) * np.array([-1.0, 0.0, 1.0])
    fine = np.unique(np.round((around[:, None] + steps).clip(0.0).ravel(), 6))
    tilts = np.unique(np.append(fine, 0.0))
    odds = _odds(points[:FINE_POINTS], tilts, recognizer)
    gain, likeliest = float(odds.max() - odds[0]), float(tilts[odds.argmax()])
    levelled = _levelled(points[:FLAT_POINTS], likeliest)
    if gain < (MIN_GAIN if levelled is None else MIN_FLAT_GAIN):
        return 0.0
    found = likeliest if levelled is None else levelled
    return found if found > np.radians(MIN_TILT) else 0.0


def tilt_rotation(tilt: float) -> Float[np.ndarray, "3 3"]:
    """Return the rotation from the axes of a camera that looks down by `tilt` (radians) to those of a level one."""
    cosine, sine = np.cos(tilt), np.sin(tilt)
    return np.array([[1.0, 0.0, 0.0], [0.0, cosine, sine], [0.0, -sine, cosine]])


def _levelled(points: Float[np.ndarray, "points 3"], tilt: float) -> float | None:
    """Correct a tilt (radians) so that nearly level surfaces, as of tops and seats, are level; None without any."""
    normals, planarity = estimate_normals(points @ tilt_rotation(tilt).T, neighbours=FLAT_NEIGHBOURS)
    normals *= -np.sign(normals[:, 1:2] + 1e-12)
    flat = (planarity > 0.3) & (normals[:, 1] < -np.cos(np.radians(FLAT_ANGLE)))
    if flat.mean() < MIN_FLAT:
        return None
    return tilt + float(np.median(np.arctan2(-normals[flat, 2], -normals[flat, 1])))


def _odds(
    points: Float[np.ndarray, "points 3"], tilts: Float[np.ndarray, " tilts"], recognizer: Recognizer
) -> Float[np.ndarray, " tilts"]:
    """Log-odds of the likeliest category in the likeliest yaw against none, for each tilt."""
    level = upright_rotation("-y")
    rotations = [yaw @ level @ tilt_rotation(tilt) for tilt in tilts.tolist() for yaw in YAWS]
    logits, _ = predict_logits(points, rotations, recognizer)
    return np.asarray(logits.max(axis=1).reshape(len(tilts), -1).max(axis=1))
