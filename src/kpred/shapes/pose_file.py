"""Camera poses in the files of many programs, each in its own convention of axes."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from kpred.errors import ConfigError
from kpred.ops.typing import Float
from kpred.shapes.camera import check_pose
from kpred.shapes.formats.keyed_content import dictionaries, numbers, read_keyed

OPENCV_KEYS = (
    *("camera_to_world", "cam_to_world", "cam2world", "c2w", "camera_pose", "aligned_pose", "pose", "t_wc"),
    *("t_world_camera", "t_world_cam", "world_from_camera", "world_from_cam", "world_t_camera", "cameratoworld"),
)
"""Camera-to-world, x right, y down, z forward."""

OPENGL_KEYS = ("transform_matrix", "transformmatrix", "cameraposearframe", "transform")
"""Camera-to-world, x right, y up, z backward: NeRF, instant-ngp, nerfstudio, ARKit."""

INVERSE_KEYS = (
    *("world_to_camera", "world_to_cam", "world2cam", "w2c", "t_cw", "t_camera_world", "t_cam_world"),
    *("camera_from_world", "cam_from_world", "camera_t_world", "worldtocamera", "extrinsics"),
)
"""World-to-camera, x right, y down, z forward."""

_POLYCAM = tuple(f"t_{row}{column}" for row in range(3) for column in range(4))
_TUM = ("tx", "ty", "tz", "qx", "qy", "qz", "qw")
_FLIP = np.diag([1.0, -1.0, -1.0, 1.0])


def read_pose(path: str | os.PathLike[str], picture: str | os.PathLike[str] | None = None) -> Float[np.ndarray, "4 4"]:
    """Read a camera-to-world matrix (4, 4) with x right, y down, z forward.

    Files: .txt, .npy, .json, .yaml of the matrix, of a line `[time] tx ty tz qx qy qz qw` (TUM), or of keys. The key
    says the convention: `camera_to_world`, `pose`, ... as here; `transform_matrix` (nerfstudio), `cameraPoseARFrame`,
    `t_00` (Polycam) with y up and z backward, which are converted; `world_to_camera`, `extrinsic` (Open3D) and
    `cam_R_w2c` (BOP, millimetres) are inverted; `position` and `orientation` (ROS) are as here. Of a list of `frames`,
    the one of `picture` is taken, by the stem of its name.

    Raises:
        ScanError: the frame's tracking was lost (entries that are not finite).
        ConfigError: missing, unreadable, or not a rigid motion.
    """
    file = Path(path)
    content = read_keyed(file, "pose")
    if isinstance(content, list) and [len(row) for row in content if isinstance(row, list)] == [3, 4, 4, 4, 4]:
        content = content[1:]  # Open3D's .log: numbers of frames come first.
    if isinstance(content, dict):
        return pose_of(file, _frame(file, content, picture), picture)
    return check_pose(_square(numbers(file, content)), str(file))


def pose_of(
    file: Path, content: dict[str, Any], picture: str | os.PathLike[str] | None = None
) -> Float[np.ndarray, "4 4"]:
    """Find the camera-to-world matrix (4, 4) in the content of a file; see `read_pose`.

    Raises:
        ScanError: the frame's tracking was lost.
        ConfigError: there is none, or several, or it is no rigid motion.
    """
    return check_pose(_of_keys(file, content, picture), str(file))


def _frame(file: Path, content: dict[str, Any], picture: str | os.PathLike[str] | None) -> dict[str, Any]:
    """Find the dictionary with the pose: the file's own, or that of one of its frames."""
    frames = content.get("frames")
    if not isinstance(frames, list) or not frames:
        return content
    known = [frame for frame in frames if isinstance(frame, dict)]
    if picture is not None:
        stem = Path(picture).stem
        named = [frame for frame in known if stem in {Path(v).stem for v in frame.values() if isinstance(v, str)}]
        known = named if len(named) == 1 else known
    if len(known) != 1:
        raise ConfigError(f"{file}: it holds the poses of {len(known)} frames; give a file with that of the picture.")
    return known[0]


def _of_keys(file: Path, content: dict[str, Any], picture: str | os.PathLike[str] | None) -> np.ndarray:
    """Find the pose in nested keys; of several, the one under the name of the picture."""
    found = [(path, pose) for path, item in dictionaries(content) if (pose := _of_dictionary(file, item)) is not None]
    if not found:
        raise ConfigError(f"{file}: it names no pose; give a 4 x 4 matrix under the key camera_to_world.")
    if len(found) > 1 and picture is not None:
        stem = Path(picture).stem.lower()
        found = [(path, pose) for path, pose in found if stem in path.split("/")] or found
    if any(not np.array_equal(pose, found[0][1]) for _, pose in found):
        raise ConfigError(f"{file}: it holds {len(found)} poses; give a file with that of the picture.")
    return found[0][1]


def _of_dictionary(file: Path, item: dict[str, Any]) -> np.ndarray | None:
    lowered = {str(key).lower(): value for key, value in item.items()}
    if all(key in lowered for key in _POLYCAM):
        rows = numbers(file, [lowered[key] for key in _POLYCAM]).reshape(3, 4)
        return np.concatenate([rows, [[0.0, 0.0, 0.0, 1.0]]]) @ _FLIP
    for keys, convention in ((OPENCV_KEYS, "cv"), (OPENGL_KEYS, "gl"), (INVERSE_KEYS, "inverse")):
        key = next((key for key in keys if isinstance(lowered.get(key), list)), None)
        if key is not None:
            return _converted(file, _square(numbers(file, lowered[key])), convention)
    if all(key in lowered for key in _TUM):
        return _square(numbers(file, [lowered[key] for key in _TUM]))
    for place, turn in (("position", "orientation"), ("translation", "rotation")):
        if isinstance(lowered.get(place), dict) and isinstance(lowered.get(turn), dict):
            return _of_ros(file, lowered[place], lowered[turn])
    if isinstance(lowered.get("cam_r_w2c"), list) and isinstance(lowered.get("cam_t_w2c"), list):
        return _of_bop(file, lowered["cam_r_w2c"], lowered["cam_t_w2c"])
    if isinstance(lowered.get("extrinsic"), list):
        # Open3D writes it column by column, world-to-camera.
        array = numbers(file, lowered["extrinsic"])
        return _converted(file, array.reshape(4, 4).T if array.shape == (16,) else _square(array), "inverse")
    return None


def _of_ros(file: Path, position: dict[str, Any], orientation: dict[str, Any]) -> np.ndarray | None:
    """Read a pose of ROS, of the camera's optical frame."""
    try:
        values = [position[axis] for axis in "xyz"] + [orientation[axis] for axis in "xyzw"]
    except KeyError:
        return None
    return _square(numbers(file, values))


def _of_bop(file: Path, rotation: list[Any], translation: list[Any]) -> np.ndarray:
    """Read a pose of BOP: world-to-camera, millimetres."""
    turn, place = numbers(file, rotation), numbers(file, translation)
    if turn.size != 9 or place.size != 3:
        raise ConfigError(f"{file}: cam_R_w2c and cam_t_w2c must hold 9 and 3 numbers; save the pose again.")
    matrix = np.eye(4)
    matrix[:3, :3], matrix[:3, 3] = turn.reshape(3, 3), place.ravel() / 1000.0
    return _converted(file, matrix, "inverse")


def _converted(file: Path, matrix: np.ndarray, convention: str) -> np.ndarray:
    pose = check_pose(matrix, str(file))
    if convention == "gl":
        return pose @ _FLIP
    return np.linalg.inv(pose) if convention == "inverse" else pose


def _square(array: np.ndarray) -> np.ndarray:
    """Convert a matrix in one row, or TUM's position and quaternion, to (4, 4) or (3, 4)."""
    flat = array.ravel()
    if flat.size in (7, 8) and min(array.shape) in (1, flat.size):
        position, quaternion = flat[-7:-4], flat[-4:]
        if abs(np.linalg.norm(quaternion) - 1) < 1e-2:
            pose = np.eye(4)
            pose[:3, :3], pose[:3, 3] = Rotation.from_quat(quaternion).as_matrix(), position
            return pose
    if (array.ndim < 2 or 1 in array.shape) and array.size in (12, 16):
        square = array.reshape(-1, 4)
        # Column by column: the last row then stands where the translation must be.
        is_turned = square.shape == (4, 4) and square[3, :3].any() and not square[:3, 3].any() and square[3, 3] == 1
        return square.T if is_turned else square
    return array
