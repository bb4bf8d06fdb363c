"""Rotations of named up axes to y, and about y."""

from __future__ import annotations

import numpy as np

from kpred.errors import ConfigError
from kpred.ops.typing import Float

UP_AXES = {"x": (1, 0, 0), "y": (0, 1, 0), "z": (0, 0, 1), "-x": (-1, 0, 0), "-y": (0, -1, 0), "-z": (0, 0, -1)}

Y_TO_Z = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, -1.0], [0.0, 1.0, 0.0]])
"""Rotation from y up to z up."""


def upright_rotation(up: str) -> Float[np.ndarray, "3 3"]:
    """Return the shortest rotation of the named axis to +y; for z up: (x, y, z) -> (x, z, -y).

    Raises:
        ConfigError: if `up` is no axis name.
    """
    if up not in UP_AXES:
        raise ConfigError(f"The up axis must be one of {', '.join(UP_AXES)}, but is '{up}'.")
    axis_up = np.array(UP_AXES[up], dtype=np.float64)
    if axis_up[1] == 1:
        return np.eye(3)
    if axis_up[1] == -1:
        return np.diag([1.0, -1.0, -1.0])
    axis = np.cross(axis_up, [0.0, 1.0, 0.0])
    cross = np.array([[0, -axis[2], axis[1]], [axis[2], 0, -axis[0]], [-axis[1], axis[0], 0]])
    return np.eye(3) + cross + cross @ cross


def yaw_rotation(angle: float) -> Float[np.ndarray, "3 3"]:
    """Return the rotation by an angle (radians) about +y; it takes +z towards +x."""
    c, s = np.cos(angle), np.sin(angle)
    return np.array([[c, 0, s], [0, 1, 0], [-s, 0, c]])
