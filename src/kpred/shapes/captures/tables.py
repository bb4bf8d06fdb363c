"""Files that hold the poses of many frames: trajectories of TUM, ARKitScenes, Stray Scanner, Replica and Open3D."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from scipy.spatial.transform import Rotation

from kpred.errors import ConfigError
from kpred.ops.typing import Float
from kpred.shapes.formats.records import number_of, split_line
from kpred.shapes.formats.text_lines import open_lines
from kpred.shapes.reading import check_file, reading

_MAX_BYTES = 1 << 28


def number_rows(file: Path) -> list[list[float]]:
    """Read the rows of numbers of a text file; comments, names of columns and other words are left out.

    Raises:
        ConfigError: missing, unreadable or too large.
    """
    check_file(file, ConfigError, "file of poses")
    if file.stat().st_size > _MAX_BYTES:
        raise ConfigError(f"{file}: it is too large to be a file of poses; give the right file.")
    found = []
    with reading(file, ConfigError, "file of poses"), open_lines(file) as lines:
        for line in lines:
            words = split_line(line.split(b"#", 1)[0].strip())
            try:
                row = [number_of(word) for word in words if word]
            except ValueError:
                continue
            if row:
                found.append(row)
    return found


def named_times(file: Path) -> list[tuple[float, str]]:
    """Read lines `time name`, as TUM lists its pictures.

    Raises:
        ConfigError: missing or unreadable.
    """
    check_file(file, ConfigError, "list of pictures")
    found = []
    with reading(file, ConfigError, "list of pictures"), open_lines(file) as lines:
        for line in lines:
            words = line.split(b"#", 1)[0].split()
            if len(words) == 2:
                found.append((number_of(words[0]), words[1].decode("utf-8", "surrogateescape")))
    return found


def quaternion_poses(places: np.ndarray, quaternions: np.ndarray, file: Path) -> Float[np.ndarray, "frames 4 4"]:
    """Build poses of places (N, 3) and quaternions (N, 4), x y z w.

    Raises:
        ConfigError: a quaternion is none.
    """
    lengths = np.linalg.norm(quaternions, axis=1)
    if not (np.abs(lengths - 1) < 0.05).all():
        raise ConfigError(f"{file}: its rotations are no unit quaternions; export the poses again.")
    poses = np.tile(np.eye(4), (len(places), 1, 1))
    poses[:, :3, :3] = Rotation.from_quat(quaternions).as_matrix()
    poses[:, :3, 3] = places
    return poses


def matrix_poses(file: Path) -> Float[np.ndarray, "frames 4 4"]:
    """Read poses of 16 or 12 numbers a row (Replica, KITTI), or of four rows each (Open3D's .log, with its numbers).

    Raises:
        ConfigError: something else stands there.
    """
    rows = number_rows(file)
    widths = {len(row) for row in rows}
    if widths <= {16, 12}:
        return np.stack([_four(np.array(row).reshape(-1, 4)) for row in rows]) if rows else np.zeros((0, 4, 4))
    rows = [row for row in rows if len(row) == 4]
    if not rows or len(rows) % 4:
        raise ConfigError(f"{file}: it does not hold poses of four rows each; export them again.")
    return np.array(rows).reshape(-1, 4, 4)


def nearest_times(wanted: np.ndarray, known: np.ndarray, reach: float) -> np.ndarray:
    """Return, for each time (N,), the row of the nearest known one, or -1 where it is farther than `reach`."""
    if not len(known):
        return np.full(len(wanted), -1)
    order = np.argsort(known)
    ordered = known[order]
    right = np.searchsorted(ordered, wanted).clip(0, len(ordered) - 1)
    left = (right - 1).clip(0)
    nearer = np.where(np.abs(ordered[left] - wanted) <= np.abs(ordered[right] - wanted), left, right)
    return np.where(np.abs(ordered[nearer] - wanted) <= reach, order[nearer], -1)


def _four(matrix: np.ndarray) -> np.ndarray:
    return matrix if matrix.shape == (4, 4) else np.concatenate([matrix, [[0.0, 0.0, 0.0, 1.0]]])
