"""The camera of a depth picture, from intrinsics that may be those of a larger picture of the same view."""

from __future__ import annotations

import numpy as np

from kpred.errors import ConfigError, ScanError
from kpred.shapes.camera import Camera
from kpred.shapes.intrinsics_file import IntrinsicsFile


def depth_camera(
    depth: np.ndarray, intrinsics: IntrinsicsFile, camera_to_world: np.ndarray, name: str, intrinsics_name: str
) -> Camera:
    """Return the camera of a depth picture (height, width); intrinsics of another size are scaled.

    Args:
        camera_to_world: (4, 4).
        name, intrinsics_name: what messages call the picture and the file of intrinsics.

    Raises:
        ScanError: the intrinsics belong to pictures of other proportions.
        ConfigError: the principal point lies outside of the picture, as with intrinsics of a larger one.
    """
    height, width = depth.shape
    size = intrinsics.size or (width, height)
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
    if not (-1 <= cx <= width and -1 <= cy <= height):
        raise ConfigError(
            f"{intrinsics_name}: the principal point ({cx:.0f}, {cy:.0f}) lies outside of the depth picture of "
            f"{width} x {height}; give the intrinsics of the depth camera, or their width and height with them."
        )
    return camera
