"""Pose proposals: the up axis of a scan, and its rotations and categories worth trying."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from kpred.errors import ConfigError
from kpred.nn import Recognizer
from kpred.ops.rotations import upright_rotation, yaw_rotation
from kpred.pose.estimators import PoseEstimator, UprightPose, pose_estimator
from kpred.pose.recognition import (
    COARSE_POINTS,
    POINTS,
    PoseHypothesis,
    make_hypotheses,
    predict_logits,
    recognize_poses,
    select_odds,
)
from kpred.pose.up_axis import PRIOR, up_scores
from kpred.pose.yaw import MERGE_ANGLE

UPRIGHT_YAWS = 4
"""Number of yaws without a recognizer, beside the identity: quarter turns of the likeliest direction."""

ROTATED_LOG_ODDS = -0.3
"""Log-odds, without a recognizer, of a rotated scan: stools have no front, so the identity is preferred."""

MAX_AXES = 3
"""Number of up axes given to the recognizer, the likeliest first."""

MAX_AXIS_DEFICIT = 4.0
"""Axes whose geometric log-odds are this much below the best are skipped."""

AXIS_POINTS = 128
CLOSE_LOG_ODDS = 2.5
FINE_YAWS = 4
"""The first pass uses `AXIS_POINTS` points; axes within `CLOSE_LOG_ODDS` of the best get a second pass with all points,
in their `FINE_YAWS` best yaws.
"""

EVIDENCE_WEIGHT = 0.5
"""Weight of the geometric evidence for an up axis beside the recognizer, since each is overconfident."""


def check_known_frame(points: np.ndarray) -> None:
    """Check that a scan (N, 3) is canonical: y up, front +z, in the unit box of its whole object.

    Raises:
        ConfigError: if it reaches far beyond that box.
    """
    if np.abs(points).max() > 1.5:
        raise ConfigError(
            "frame='known' takes a scan inside its object's unit box [-1, 1]^3, but this one reaches "
            f"{np.abs(points).max():.3g}; use frame='auto'."
        )


def up_axis(points: np.ndarray, up: str, recognizer: Recognizer | None = None) -> str:
    """Return `up` itself, or for "auto" the likeliest up axis by geometry and recognizer.

    Raises:
        ConfigError: if `up` is no axis name.
    """
    if up != "auto":
        upright_rotation(up)
        return up
    scores = up_scores(points)
    order = sorted(scores, key=lambda name: -scores[name])
    if recognizer is None:
        return order[0]
    axes = order[:MAX_AXES]
    before = np.array([PRIOR[name] + EVIDENCE_WEIGHT * (scores[name] - PRIOR[name]) for name in axes])
    likely = before >= before[0] - MAX_AXIS_DEFICIT
    axes, before = [name for name, one in zip(axes, likely, strict=True) if one], before[likely]
    if len(axes) == 1:
        return axes[0]
    yaws = np.radians(np.arange(0, 360, 30))
    rotations = [[yaw_rotation(yaw) @ upright_rotation(name) for yaw in yaws] for name in axes]
    # Few points separate most axes; close ones get all points, in their best yaws.
    coarse, _ = predict_logits(points[:AXIS_POINTS], [one for each in rotations for one in each], recognizer)
    odds = coarse.max(axis=1).reshape(len(axes), len(yaws))
    total = before + odds.max(axis=1)
    close = np.flatnonzero(total >= total.max() - CLOSE_LOG_ODDS)
    if len(close) == 1:
        return axes[int(close[0])]
    best = np.argsort(-odds, axis=1)[:, :FINE_YAWS]
    fine, _ = predict_logits(
        points[:POINTS], [rotations[axis][yaw] for axis in close for yaw in best[axis]], recognizer
    )
    total = before[close] + fine.max(axis=1).reshape(len(close), -1).max(axis=1)
    return axes[int(close[int(total.argmax())])]


def generate_poses(
    points: np.ndarray,
    up: str,
    pose: PoseEstimator | str | None,
    recognizer: Recognizer | None,
    categories: Sequence[str],
) -> list[PoseHypothesis]:
    """Return rotations and categories worth trying, the likeliest first.

    Args:
        points: (N, 3) in any unit; up: the up axis, as `up_axis` gives it.
        pose: an estimator or its name; None: the recognizer finds the yaw; without one, the identity and the quarter
            turns of the likeliest direction are used.
        recognizer: used if it knows all of the categories.

    Raises:
        ConfigError: if `up` is no axis name, or there is no such estimator.
    """
    usable = recognizer if recognizer is not None and recognizer.knows(categories) else None
    if pose is None and usable is not None:
        return recognize_poses(points, upright_rotation(up), usable, categories)
    if pose is not None:
        rotations = (pose_estimator(pose) if isinstance(pose, str) else pose)(points, up)
    else:
        rotations = [upright_rotation(up)]
        for rotation in UprightPose(max_yaws=UPRIGHT_YAWS)(points, up):
            if all(_angle_between(rotation, other) > MERGE_ANGLE for other in rotations):
                rotations.append(rotation)
    return score_poses(points, rotations, usable, categories)


def score_poses(
    points: np.ndarray, rotations: Sequence[np.ndarray], recognizer: Recognizer | None, categories: Sequence[str]
) -> list[PoseHypothesis]:
    """Combine given rotations with every category, with log-odds by the recognizer if there is one."""
    if recognizer is not None and recognizer.knows(categories):
        odds, _ = predict_logits(points[:COARSE_POINTS], rotations, recognizer)
        return make_hypotheses(rotations, select_odds(odds, recognizer, categories), categories)
    odds = np.full((len(rotations), len(categories)), ROTATED_LOG_ODDS)
    odds[0] = 0.0
    return make_hypotheses(rotations, odds, categories)


def _angle_between(a: np.ndarray, b: np.ndarray) -> float:
    return float(np.arccos(np.clip((np.trace(a @ b.T) - 1) / 2, -1, 1)))
