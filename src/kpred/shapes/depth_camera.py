"""The camera of a depth picture, from intrinsics that may be those of a larger picture of the same view."""

from __future__ import annotations

import numpy as np

from kpred.errors import ConfigError, ScanError
from kpred.shapes.camera import Camera
from kpred.shapes.intrinsics_file import IntrinsicsFile, Size

_LARGER, _SAME_RATIO = 1.4, 0.1
"""How far out, in halves of the picture, the principal point of a larger picture lies, alike across and down."""

_CENTRED = 0.25
"""Halves of a picture that its principal point may lie off its middle."""


def depth_camera(
    depth: np.ndarray,
    intrinsics: IntrinsicsFile,
    camera_to_world: np.ndarray,
    name: str,
    intrinsics_name: str,
    photograph: Size | None = None,
) -> Camera:
    """Return the camera of a depth picture (height, width); intrinsics of another size are scaled.

    Args:
        camera_to_world: (4, 4).
        name, intrinsics_name: what messages call the picture and the file of intrinsics.
        photograph: size of a photograph of the same view, whose intrinsics these may be.

    Raises:
        ScanError: the intrinsics belong to pictures of other proportions.
        ConfigError: the principal point is that of a larger picture.
    """
    height, width = depth.shape
    size = intrinsics.size or (width, height)
    if intrinsics.size is None and photograph is not None and _is_centred(intrinsics.matrix, photograph):
        size = (width, height) if _is_centred(intrinsics.matrix, size) else photograph
    try:
        camera = Camera(intrinsics.matrix, size[0], size[1], camera_to_world).resized(width, height)
    except ConfigError as error:
        if size == (width, height):
            raise
        raise ScanError(
            f"{name}: the depth picture has {width} x {height} pixels, but {intrinsics_name} is of a camera with "
            f"{size[0]} x {size[1]}; give the intrinsics of the depth camera."
        ) from error
    cx, cy = camera.intrinsics[0, 2], camera.intrinsics[1, 2]
    across, down = (2 * cx + 1) / width, (2 * cy + 1) / height
    is_larger = across > _LARGER and abs(across / down - 1) < _SAME_RATIO
    if is_larger or not (-1 <= cx <= width and -1 <= cy <= height):
        raise ConfigError(
            f"{intrinsics_name}: the principal point ({cx:.0f}, {cy:.0f}) is not that of a depth picture of "
            f"{width} x {height}; give the intrinsics of the depth camera, or their width and height with them."
        )
    return camera


def _is_centred(matrix: np.ndarray, size: Size) -> bool:
    """Test whether the principal point lies near the middle of a picture of this size."""
    return all(abs((2 * matrix[axis, 2] + 1) / size[axis] - 1) < _CENTRED for axis in (0, 1))
