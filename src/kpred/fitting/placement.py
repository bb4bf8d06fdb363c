"""Where the scan stands: from its gravity direction and its footprint to hypotheses of its unit-box frame."""

from __future__ import annotations

import numpy as np
from scipy.spatial import ConvexHull, QhullError

from kpred.errors import ConfigError
from kpred.ops.frames import Frame, unit_box_frame

UP_AXES = {"x": (1, 0, 0), "y": (0, 1, 0), "z": (0, 0, 1), "-x": (-1, 0, 0), "-y": (0, -1, 0), "-z": (0, 0, -1)}


def known_frame(points: np.ndarray) -> Frame:
    """The scan is canonical already: y up, front +z, in the unit box of its whole object."""
    if np.abs(points).max() > 1.5:
        raise ConfigError(
            "frame='known' takes a scan inside its object's unit box [-1, 1]^3, but this one reaches "
            f"{np.abs(points).max():.3g}; use frame='auto'."
        )
    return Frame(center=np.zeros(3), scale=1.0)


def frame_hypotheses(points: np.ndarray, up: str = "y") -> list[Frame]:
    """Unit-box frames worth trying for a scan whose yaw is unknown.

    The scan as it stands comes first; then four quarter turns of the tightest rectangle around its footprint, since
    furniture is mostly rectangular. Each frame holds the scan's own box: of a partial scan the visible part's.

    Raises:
        ConfigError: if `up` is no axis name.
        ScanError: if the points have no extent.
    """
    if up not in UP_AXES:
        raise ConfigError(f"The up axis must be one of {', '.join(UP_AXES)}, but is '{up}'.")
    upright = _upright(np.array(UP_AXES[up], dtype=np.float64))
    yaw = _footprint_yaw((points @ upright.T)[:, [0, 2]])
    turns = [0.0]
    for quarter in range(4):
        turn = (yaw + quarter * np.pi / 2 + np.pi) % (2 * np.pi) - np.pi
        # As-it-stands and a rectangle turned by under two degrees are one hypothesis.
        if all(abs((turn - other + np.pi) % (2 * np.pi) - np.pi) > np.radians(2) for other in turns):
            turns.append(turn)
    return [unit_box_frame(points, _yaw_rotation(turn) @ upright) for turn in turns]


def _upright(up: np.ndarray) -> np.ndarray:
    """Shortest rotation that takes `up` to +y; for z up that is (x, y, z) -> (x, z, -y)."""
    if up[1] == 1:
        return np.eye(3)
    if up[1] == -1:
        return np.diag([1.0, -1.0, -1.0])
    axis = np.cross(up, [0.0, 1.0, 0.0])
    cross = np.array([[0, -axis[2], axis[1]], [axis[2], 0, -axis[0]], [-axis[1], axis[0], 0]])
    return np.eye(3) + cross + cross @ cross


def _yaw_rotation(angle: float) -> np.ndarray:
    c, s = np.cos(angle), np.sin(angle)
    return np.array([[c, 0, s], [0, 1, 0], [-s, 0, c]])


def _footprint_yaw(footprint: np.ndarray) -> float:
    """Turn about y that makes the tightest rectangle around the (x, z) footprint axis-aligned."""
    # A few stray points must not turn the rectangle.
    middle = np.median(footprint, axis=0)
    reach = np.abs(footprint - middle).max(axis=1)
    core = footprint[reach <= np.quantile(reach, 0.995)]
    try:
        corners = core[ConvexHull(core).vertices]
    except QhullError:
        return 0.0
    edges = np.roll(corners, -1, axis=0) - corners
    angles = np.unique(np.arctan2(edges[:, 1], edges[:, 0]) % (np.pi / 2))
    c, s = np.cos(angles), np.sin(angles)
    along = corners @ np.stack([c, s])
    across = corners @ np.stack([-s, c])
    area = np.ptp(along, axis=0) * np.ptp(across, axis=0)
    return float(angles[area.argmin()])
