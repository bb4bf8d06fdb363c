"""Where the scan stands: its up axis, and the ways in which it may be turned and read."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from kpred.errors import ConfigError
from kpred.nn import Recognizer
from kpred.ops.rotations import upright_rotation, yaw_rotation
from kpred.pose.estimators import PoseEstimator, UprightPose, pose_estimator
from kpred.pose.recognition import FIRST_POINTS, POINTS, Reading, ask, readings, recognised
from kpred.pose.up_axis import PRIOR, up_scores
from kpred.pose.yaw import SAME

YAWS = 4
"""Turns tried without a recognizer beside the scan as it stands: the quarters of its likeliest direction."""

TURN_ODDS = -0.3
"""Log-odds, without a recognizer, of a scan that must be turned: stools have no front, and are taken as they stand."""

TRIED_AXES = 3
"""Up axes that the recognizer is asked about, the likeliest first."""

HOPELESS_AXIS = 4.0
"""Axes that geometry puts so much below its first (log-odds) are not asked about: on 330 depth scans of training shapes
none of them was chosen.
"""

GLANCE_POINTS = 128
CLOSE_AXES = 2.5
GLANCE_TURNS = 4
"""The recognizer is first asked with so few points. On 300 scans of shapes it was not trained on, axes that it then
puts more than this apart (log-odds) are in the same order with all points. The others are asked about again with all
points, in so many of their best turns.
"""

EVIDENCE_SHARE = 0.5
"""Weight of the geometric evidence for an up axis where the recognizer has its say too: each is too sure of itself."""


def check_known_frame(points: np.ndarray) -> None:
    """The scan is canonical already: y up, front +z, in the unit box of its whole object.

    Raises:
        ConfigError: if it reaches far beyond that box.
    """
    if np.abs(points).max() > 1.5:
        raise ConfigError(
            "frame='known' takes a scan inside its object's unit box [-1, 1]^3, but this one reaches "
            f"{np.abs(points).max():.3g}; use frame='auto'."
        )


def up_axis(points: np.ndarray, up: str, recognizer: Recognizer | None = None) -> str:
    """The axis itself, or the likeliest one where it is "auto": by geometry and by what the recognizer sees then.

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
    axes = order[:TRIED_AXES]
    before = np.array([PRIOR[name] + EVIDENCE_SHARE * (scores[name] - PRIOR[name]) for name in axes])
    likely = before >= before[0] - HOPELESS_AXIS
    axes, before = [name for name, one in zip(axes, likely, strict=True) if one], before[likely]
    if len(axes) == 1:
        return axes[0]
    turns = [yaw_rotation(turn) for turn in np.radians(np.arange(0, 360, 30))]
    rotations = [[turn @ upright_rotation(name) for turn in turns] for name in axes]
    # Few points tell most axes apart; those that are close are asked about again with all, in their best turns.
    glance, _ = ask(points[:GLANCE_POINTS], [one for each in rotations for one in each], recognizer)
    odds = glance.max(axis=1).reshape(len(axes), len(turns))
    total = before + odds.max(axis=1)
    close = np.flatnonzero(total >= total.max() - CLOSE_AXES)
    if len(close) == 1:
        return axes[int(close[0])]
    best = np.argsort(-odds, axis=1)[:, :GLANCE_TURNS]
    closely, _ = ask(points[:POINTS], [rotations[axis][turn] for axis in close for turn in best[axis]], recognizer)
    total = before[close] + closely.max(axis=1).reshape(len(close), -1).max(axis=1)
    return axes[int(close[int(total.argmax())])]


def placements(
    points: np.ndarray,
    up: str,
    pose: PoseEstimator | str | None,
    recognizer: Recognizer | None,
    categories: Sequence[str],
) -> list[Reading]:
    """Rotations and categories worth trying, the likeliest first.

    Args:
        points: (N, 3) in any unit; up: the up axis, as `up_axis` gives it.
        pose: an estimator or its name; None: the recognizer finds the yaw, or, without one, the scan is taken as it
            stands and turned by the quarters of its likeliest direction.
        recognizer: used if it knows all of the categories.

    Raises:
        ConfigError: if `up` is no axis name, or there is no such estimator.
    """
    judge = recognizer if recognizer is not None and set(categories) <= set(recognizer.config.categories) else None
    if pose is None and judge is not None:
        return recognised(points, upright_rotation(up), judge, categories)
    if pose is not None:
        rotations = (pose_estimator(pose) if isinstance(pose, str) else pose)(points, up)
    else:
        rotations = [upright_rotation(up)]
        for rotation in UprightPose(most=YAWS)(points, up):
            if all(_angle_between(rotation, other) > SAME for other in rotations):
                rotations.append(rotation)
    return judged(points, rotations, judge, categories)


def judged(
    points: np.ndarray, rotations: Sequence[np.ndarray], recognizer: Recognizer | None, categories: Sequence[str]
) -> list[Reading]:
    """Every given rotation with every category, with the recognizer's odds where there is one."""
    if recognizer is not None and set(categories) <= set(recognizer.config.categories):
        columns = [recognizer.config.categories.index(name) for name in categories]
        return readings(rotations, ask(points[:FIRST_POINTS], rotations, recognizer)[0][:, columns], categories)
    odds = np.full((len(rotations), len(categories)), TURN_ODDS)
    odds[0] = 0.0
    return readings(rotations, odds, categories)


def _angle_between(a: np.ndarray, b: np.ndarray) -> float:
    return float(np.arccos(np.clip((np.trace(a @ b.T) - 1) / 2, -1, 1)))
