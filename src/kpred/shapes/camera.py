"""A pinhole camera: intrinsics, size of the picture, place in the world; and the files these are kept in.

Axes are OpenCV's: x to the right of the picture, y down, z forward. Pixel (column u, row v) has its centre at exactly
(u, v), so the picture spans -0.5 to width - 0.5. Lengths are metres wherever depth pictures are involved.
"""

from __future__ import annotations

import json
import os
from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np

from kpred.errors import ConfigError, ScanError

_ROTATION_TOLERANCE = 5e-3
"""How far R R^T of a pose may be from the identity: poses are often written with few digits."""

_ASPECT_TOLERANCE = 0.02
_NUMBER_KEYS = ("fx", "fy", "cx", "cy")
_MATRIX_KEYS = ("intrinsic_matrix", "camera_matrix", "intrinsics", "intrinsic", "K", "data")
_POSE_KEYS = ("camera_to_world", "cam_to_world", "cam2world", "c2w", "pose", "transform_matrix")


@dataclass(frozen=True, eq=False)
class Camera:
    """A pinhole camera without lens distortion.

    Attributes:
        intrinsics: (3, 3) float64, pixels: [[fx, skew, cx], [0, fy, cy], [0, 0, 1]].
        width, height: of the picture in pixels.
        camera_to_world: (4, 4) float64 rigid motion from camera axes (x right, y down, z forward) to the world's.

    Raises:
        ConfigError: singular or ill-formed intrinsics, a picture without pixels, or a pose that is not rigid.
    """

    intrinsics: np.ndarray
    width: int
    height: int
    camera_to_world: np.ndarray = field(default_factory=lambda: np.eye(4))

    def __post_init__(self) -> None:
        if self.width < 1 or self.height < 1:
            raise ConfigError(f"A camera needs a picture of at least one pixel, not {self.width} x {self.height}.")
        object.__setattr__(self, "intrinsics", check_intrinsics(self.intrinsics))
        object.__setattr__(self, "camera_to_world", check_pose(self.camera_to_world))

    @property
    def origin(self) -> np.ndarray:
        """(3,) where the camera stands, in the world."""
        return self.camera_to_world[:3, 3].copy()

    def project(self, points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """World points (..., 3) -> pixels (..., 2) as (u, v) and depths (...,) along the viewing axis.

        Depth is positive in front of the camera; pixels of points with depth <= 0 mean nothing (NaN at depth 0).
        """
        local = self.to_camera(points)
        depth = local[..., 2]
        with np.errstate(divide="ignore", invalid="ignore"):
            plane = local / depth[..., None]
        return plane @ self.intrinsics[:2].T, depth

    def unproject(self, pixels: np.ndarray, depth: np.ndarray) -> np.ndarray:
        """Pixels (..., 2) as (u, v) and depths (...,) -> world points (..., 3); the inverse of `project`."""
        pixels, depth = np.asarray(pixels, dtype=np.float64), np.asarray(depth, dtype=np.float64)
        rays = np.concatenate([pixels, np.ones((*pixels.shape[:-1], 1))], axis=-1) @ np.linalg.inv(self.intrinsics).T
        return (rays * depth[..., None]) @ self.camera_to_world[:3, :3].T + self.camera_to_world[:3, 3]

    def to_camera(self, points: np.ndarray) -> np.ndarray:
        """World points (..., 3) -> the camera's axes, (..., 3) float64."""
        moved = np.asarray(points, dtype=np.float64) - self.camera_to_world[:3, 3]
        return moved @ self.camera_to_world[:3, :3]

    def resized(self, width: int, height: int) -> Camera:
        """The same camera with a picture of another size, as when colour and depth frames differ in resolution.

        Raises:
            ConfigError: the proportions differ by more than 2 %, so that it cannot be the same view.
        """
        sx, sy = width / self.width, height / self.height
        if abs(sx / sy - 1) > _ASPECT_TOLERANCE:
            raise ConfigError(
                f"A picture of {width} x {height} has other proportions than the camera's {self.width} x "
                f"{self.height}, so it shows another view; give a picture of the same view."
            )
        # The outer borders coincide, and pixel centres lie half a pixel inside them.
        scaling = np.array([[sx, 0, 0.5 * sx - 0.5], [0, sy, 0.5 * sy - 0.5], [0, 0, 1]])
        return replace(self, intrinsics=scaling @ self.intrinsics, width=width, height=height)


def check_intrinsics(matrix: np.ndarray, name: str = "intrinsics") -> np.ndarray:
    """(3, 3) or ScanNet's (4, 4) matrix -> (3, 3) float64 with last row 0 0 1.

    Raises:
        ConfigError: wrong shape, not finite, last row not 0 0 1, or no positive focal lengths (singular).
    """
    array = np.asarray(matrix, dtype=np.float64)
    if array.shape == (4, 4):
        array = array[:3, :3]
    if array.shape != (3, 3):
        raise ConfigError(
            f"{name}: intrinsics are a 3 x 3 or 4 x 4 matrix, not {_shape(array)}; give fx 0 cx / 0 fy cy / 0 0 1."
        )
    if not np.isfinite(array).all():
        raise ConfigError(f"{name}: the intrinsics hold NaN or infinite numbers; give fx 0 cx / 0 fy cy / 0 0 1.")
    if not np.allclose(array[2], [0, 0, 1]) or not np.isclose(array[1, 0], 0):
        raise ConfigError(f"{name}: it is not an intrinsic matrix; its rows must be fx 0 cx / 0 fy cy / 0 0 1.")
    if array[0, 0] <= 0 or array[1, 1] <= 0:
        raise ConfigError(
            f"{name}: the focal lengths are {array[0, 0]:g} and {array[1, 1]:g}, so nothing can be projected; "
            "they must be positive, in pixels."
        )
    return array.copy()


def check_pose(matrix: np.ndarray, name: str = "pose") -> np.ndarray:
    """(4, 4) or (3, 4) matrix -> (4, 4) float64 whose rotation is exactly one (rounding of the file is mended).

    Raises:
        ScanError: the pose is not finite, which is how ScanNet marks frames whose tracking was lost.
        ConfigError: wrong shape, or not a rotation and a translation.
    """
    array = np.asarray(matrix, dtype=np.float64)
    if array.shape == (3, 4):
        array = np.concatenate([array, [[0.0, 0.0, 0.0, 1.0]]])
    if array.shape != (4, 4):
        raise ConfigError(f"{name}: a camera pose is a 4 x 4 matrix, not {_shape(array)}; give camera-to-world.")
    if not np.isfinite(array).all():
        raise ScanError(f"{name}: the pose is not finite: tracking was lost in this frame; leave the frame out.")
    if not np.allclose(array[3], [0, 0, 0, 1]):
        raise ConfigError(f"{name}: the last row of a pose is 0 0 0 1; write the matrix row by row, camera-to-world.")
    left, stretch, right = np.linalg.svd(array[:3, :3])
    if np.abs(stretch**2 - 1).max() > _ROTATION_TOLERANCE or np.linalg.det(left @ right) < 0:
        raise ConfigError(
            f"{name}: its upper left 3 x 3 is not a rotation (it scales, shears or mirrors); give a rigid "
            "camera-to-world matrix in metres."
        )
    pose = array.copy()
    pose[:3, :3] = left @ right
    return pose


def read_intrinsics(path: str | os.PathLike[str]) -> tuple[np.ndarray, tuple[int, int] | None]:
    """Intrinsics (3, 3) of a file, and the picture's (width, height) if the file names it.

    Text (.txt): 3 x 3, 4 x 4 (ScanNet) or four numbers `fx fy cx cy`. JSON: keys fx, fy, cx, cy; or a matrix under
    intrinsic_matrix (Open3D, column by column), camera_matrix, intrinsics, K; or just the matrix; optional width and
    height. NumPy (.npy): the matrix.

    Raises:
        ConfigError: missing, unreadable, or not intrinsics.
    """
    file = Path(path)
    content = _content(file, "intrinsics")
    size = None
    if isinstance(content, dict):
        size = _picture_size(file, content)
        for part in _dicts(content):
            if all(key in part for key in _NUMBER_KEYS):
                found: Any = [part[key] for key in _NUMBER_KEYS]
            else:
                found = next((part[key] for key in _MATRIX_KEYS if isinstance(part.get(key), list)), None)
            if found is not None:
                content, size = found, size or _picture_size(file, part)
                break
        else:
            raise ConfigError(f"{file}: it names no intrinsics; give the keys fx, fy, cx and cy.")
    array = _numbers(file, content)
    if array.size == 4 and array.ndim == 1 or array.shape == (1, 4):
        fx, fy, cx, cy = array.ravel()
        array = np.array([[fx, 0, cx], [0, fy, cy], [0, 0, 1]])
    elif array.shape == (9,):
        array = array.reshape(3, 3)
        # Open3D writes column by column: then the principal point stands where 0 0 must be.
        array = array.T if array[2, 0] or array[2, 1] else array
    return check_intrinsics(array, str(file)), size


def read_pose(path: str | os.PathLike[str]) -> np.ndarray:
    """Camera-to-world matrix (4, 4) of a .txt, .json (bare, or under camera_to_world, pose, ...) or .npy file.

    Raises:
        ScanError: the frame's tracking was lost (entries that are not finite).
        ConfigError: missing, unreadable, or not a rigid motion.
    """
    file = Path(path)
    content = _content(file, "pose")
    if isinstance(content, dict):
        key = next((key for key in _POSE_KEYS if key in content), None)
        if key is None:
            raise ConfigError(f"{file}: it names no pose; give a 4 x 4 matrix under the key camera_to_world.")
        content = content[key]
    array = _numbers(file, content)
    if array.ndim < 2 and array.size in (12, 16):
        array = array.reshape(-1, 4)
    return check_pose(array, str(file))


def _content(file: Path, kind: str) -> Any:
    try:
        if file.suffix.lower() == ".npy":
            return np.load(file, allow_pickle=False)
        text = file.read_text(encoding="utf-8")
        if file.suffix.lower() == ".json":
            return json.loads(text)
        if file.suffix.lower() == ".txt":
            rows = [line.partition("#")[0].replace(",", " ").split() for line in text.splitlines()]
            rows = [row for row in rows if row]
            return rows[0] if len(rows) == 1 else rows
    except FileNotFoundError as error:
        raise ConfigError(f"{file}: there is no such file; check the path of the {kind}.") from error
    except OSError as error:
        raise ConfigError(f"{file}: it cannot be read ({error.strerror or error}); check the {kind} file.") from error
    except (ValueError, EOFError) as error:
        raise ConfigError(f"{file}: it is not a readable {file.suffix} file; save the {kind} again.") from error
    raise ConfigError(f"{file}: unknown extension {file.suffix!r} of {kind}; use .txt, .json or .npy.")


def _numbers(file: Path, content: Any) -> np.ndarray:
    try:
        return np.array(content, dtype=np.float64)
    except (ValueError, TypeError) as error:
        raise ConfigError(f"{file}: its rows are not numbers of one matrix; write the matrix row by row.") from error


def _dicts(content: dict[str, Any]) -> Iterator[dict[str, Any]]:
    yield content
    for value in content.values():
        if isinstance(value, dict):
            yield from _dicts(value)


def _picture_size(file: Path, content: dict[str, Any]) -> tuple[int, int] | None:
    if "width" not in content or "height" not in content:
        return None
    width, height = content["width"], content["height"]
    if not (isinstance(width, int) and isinstance(height, int) and width > 0 and height > 0):
        raise ConfigError(f"{file}: width and height must be whole numbers of pixels, not {width!r} and {height!r}.")
    return width, height


def _shape(array: np.ndarray) -> str:
    return " x ".join(map(str, array.shape)) or "one number"
