"""A pinhole camera: intrinsics, size of the picture, place in the world.

Axes are OpenCV's: x to the right of the picture, y down, z forward. Pixel (column u, row v) has its centre at exactly
(u, v), so the picture spans -0.5 to width - 0.5. Lengths are metres wherever depth pictures are involved.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np

from kpred.errors import ConfigError, ScanError
from kpred.ops.typing import Float, Int

_ROTATION_TOLERANCE = 5e-3
"""How far R R^T of a pose may be from the identity: poses are often written with few digits."""

_ASPECT_TOLERANCE = 0.02


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

    intrinsics: Float[np.ndarray, "3 3"]
    width: int
    height: int
    camera_to_world: Float[np.ndarray, "4 4"] = field(default_factory=lambda: np.eye(4))

    def __post_init__(self) -> None:
        if self.width < 1 or self.height < 1:
            raise ConfigError(f"A camera needs a picture of at least one pixel, not {self.width} x {self.height}.")
        object.__setattr__(self, "intrinsics", check_intrinsics(self.intrinsics))
        object.__setattr__(self, "camera_to_world", check_pose(self.camera_to_world))

    @property
    def origin(self) -> Float[np.ndarray, "3"]:
        """(3,) where the camera stands, in the world."""
        return self.camera_to_world[:3, 3].copy()

    def project(
        self, points: Float[np.ndarray, "*batch 3"]
    ) -> tuple[Float[np.ndarray, "*batch 2"], Float[np.ndarray, "*batch"]]:
        """Project world points (..., 3) to pixels (..., 2) as (u, v) and depths (...,) along the viewing axis.

        Depth is positive in front of the camera; pixels of points with depth <= 0 mean nothing (NaN at depth 0).
        """
        local = self.to_camera(points)
        depth = local[..., 2]
        with np.errstate(divide="ignore", invalid="ignore"):
            plane = local / depth[..., None]
        return plane @ self.intrinsics[:2].T, depth

    def unproject(
        self, pixels: Float[np.ndarray, "*batch 2"] | Int[np.ndarray, "*batch 2"], depth: Float[np.ndarray, "*batch"]
    ) -> Float[np.ndarray, "*batch 3"]:
        """Unproject pixels (..., 2) as (u, v) and depths (...,) to world points (..., 3)."""
        pixels, depth = np.asarray(pixels, dtype=np.float64), np.asarray(depth, dtype=np.float64)
        rays = np.concatenate([pixels, np.ones((*pixels.shape[:-1], 1))], axis=-1) @ np.linalg.inv(self.intrinsics).T
        return (rays * depth[..., None]) @ self.camera_to_world[:3, :3].T + self.camera_to_world[:3, 3]

    def to_camera(self, points: Float[np.ndarray, "*batch 3"]) -> Float[np.ndarray, "*batch 3"]:
        """Transform world points (..., 3) to the camera's axes, (..., 3) float64."""
        moved = np.asarray(points, dtype=np.float64) - self.camera_to_world[:3, 3]
        return moved @ self.camera_to_world[:3, :3]

    def resized(self, width: int, height: int) -> Camera:
        """Return the same camera with a picture of another size.

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


def check_intrinsics(matrix: np.ndarray, name: str = "intrinsics") -> Float[np.ndarray, "3 3"]:
    """Check a (3, 3) or ScanNet's (4, 4) matrix; return (3, 3) float64 with last row 0 0 1.

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


def check_pose(matrix: np.ndarray, name: str = "pose") -> Float[np.ndarray, "4 4"]:
    """Check a (4, 4) or (3, 4) matrix; return (4, 4) float64 with an exact rotation.

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


def _shape(array: np.ndarray) -> str:
    return " x ".join(map(str, array.shape)) or "one number"
