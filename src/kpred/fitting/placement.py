"""Where the scan stands: from hypotheses of its rotation to frames of its visible box."""

from __future__ import annotations

import numpy as np

from kpred.errors import ConfigError
from kpred.fitting.pose import PoseEstimator, UprightPose, pose_estimator
from kpred.fitting.up_axis import find_up
from kpred.fitting.upright import SAME, upright_rotation
from kpred.ops.frames import Frame, unit_box_frame

YAWS = 4
"""Turns tried beside the scan as it stands: the quarters of its likeliest direction."""


def known_frame(points: np.ndarray) -> Frame:
    """The scan is canonical already: y up, front +z, in the unit box of its whole object."""
    if np.abs(points).max() > 1.5:
        raise ConfigError(
            "frame='known' takes a scan inside its object's unit box [-1, 1]^3, but this one reaches "
            f"{np.abs(points).max():.3g}; use frame='auto'."
        )
    return Frame(center=np.zeros(3), scale=1.0)


def up_axis(points: np.ndarray, up: str) -> str:
    """The axis itself, or the likeliest one where it is "auto"."""
    return find_up(points)[0] if up == "auto" else up


def frame_hypotheses(points: np.ndarray, up: str = "y", pose: PoseEstimator | str | None = None) -> list[Frame]:
    """Unit-box frames worth trying; each holds the scan's own box, which of a partial scan is the visible part's.

    Args:
        points: (N, 3) in any unit; up: its up axis, or "auto".
        pose: an estimator, its name, or None: the scan as it stands, then turned about its up axis.

    Raises:
        ConfigError: if `up` is no axis name, or there is no such estimator.
        ScanError: if the points have no extent.
    """
    if pose is not None:
        estimator = pose_estimator(pose) if isinstance(pose, str) else pose
        rotations = estimator(points, up)
    else:
        rotations = [upright_rotation(up_axis(points, up))]
        for rotation in UprightPose(most=YAWS)(points, up):
            if all(_angle_between(rotation, other) > SAME for other in rotations):
                rotations.append(rotation)
    return [unit_box_frame(points, rotation) for rotation in rotations]


def _angle_between(a: np.ndarray, b: np.ndarray) -> float:
    return float(np.arccos(np.clip((np.trace(a @ b.T) - 1) / 2, -1, 1)))
