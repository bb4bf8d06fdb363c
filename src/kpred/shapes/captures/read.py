"""Reading a folder of depth pictures: whose layout it is, and all that its views show in one world."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np

from kpred.errors import ConfigError, ScanError
from kpred.ops.typing import Bool
from kpred.shapes.captures import layouts, phones
from kpred.shapes.captures.capture import Capture, Frame
from kpred.shapes.captures.layouts import Given
from kpred.shapes.depth import MAX_DEPTH, DepthScan, MergedScan, merge_views, read_depth, scan_depth
from kpred.shapes.depth_camera import depth_camera
from kpred.shapes.picture_file import read_picture
from kpred.shapes.reading import reading

_LAYOUTS: tuple[Callable[[Path, Given], Capture | None], ...] = (
    phones.polycam,
    phones.scannet_plus_plus,
    phones.nerfstudio,
    phones.stray_scanner,
    phones.record3d,
    phones.scanner_app,
    layouts.arkit_scenes,
    layouts.scannet,
    layouts.seven_scenes,
    layouts.tum,
    layouts.replica,
    layouts.bop,
    layouts.open3d,
)
KINDS = (
    "ScanNet, ScanNet++, 3RScan, 7-Scenes, TUM, Replica, ARKitScenes, BOP, Open3D, nerfstudio, Polycam, Record3D, "
    "Stray Scanner or 3D Scanner App"
)

MAX_VIEWS = 60
"""Views that are merged, of those there are."""

VOXEL = 0.01
"""Metres: of the points of a room in a cube of this side, one stays."""

_MAX_PIXELS = 80_000
"""Pixels of one view beyond which rows and columns are left out."""


def read_capture(folder: Path, given: Given = None) -> Capture:
    """Find the frames of a folder, by its layout.

    Args:
        given: intrinsics, in place of those in the folder.

    Raises:
        ScanError: no layout that is known, no frame with a pose, or a file of poses or intrinsics is damaged.
    """
    for layout in _LAYOUTS:
        with reading(folder, ScanError, "folder of depth pictures"):
            capture = layout(folder, given)
        if capture is not None:
            if not capture.frames:
                raise ScanError(f"{folder}: none of its depth pictures has a pose; check the files of poses.")
            return capture
    raise ScanError(
        f"{folder}: it is no folder of depth pictures with poses, of {KINDS}; give depth pictures or a scan."
    )


def capture_scan(
    capture: Capture,
    *,
    views: int = MAX_VIEWS,
    voxel: float = VOXEL,
    depth_scale: float | None = None,
    farthest: float = MAX_DEPTH,
    remove_flying: bool = True,
    mask_of: Callable[[Frame], Bool[np.ndarray, "height width"]] | None = None,
) -> MergedScan:
    """Merge what the views of a capture show into points in its world, metres.

    Args:
        views: at most so many frames are taken, evenly spread.
        depth_scale: units per metre, in place of what the capture says.
        mask_of: the object's pixels in a frame; views without any are left out.

    Raises:
        ScanError: a picture is unreadable, or no view shows enough.
    """
    found, trouble = [], None
    for frame in capture.spread(views):
        try:
            found.append(_view(frame, depth_scale, farthest, remove_flying, mask_of))
        except ScanError as error:
            # A view may look past the object, or at nothing near; the others count.
            trouble = trouble or error
    if not found:
        raise trouble or ScanError("The capture has no views; record it again.")
    return merge_views(found, voxel)


def _view(
    frame: Frame,
    depth_scale: float | None,
    farthest: float,
    remove_flying: bool,
    mask_of: Callable[[Frame], Bool[np.ndarray, "height width"]] | None,
) -> DepthScan:
    """Back-project one frame."""
    depth = read_depth(frame.depth, depth_scale, frame.intrinsics.units_per_metre)
    camera = depth_camera(depth, frame.intrinsics, frame.camera_to_world, str(frame.depth), str(frame.depth.parent))
    if frame.confidence is not None:
        depth = np.where(_is_sure(frame.confidence, depth.shape), depth, 0.0)
    mask = None if mask_of is None else mask_of(frame)
    step = int(np.ceil(np.sqrt(depth.size / _MAX_PIXELS))) if mask is None else 1
    kept = scan_depth(depth, camera, mask, farthest=farthest, remove_flying=remove_flying, name=str(frame.depth))
    if step == 1:
        return kept
    rows = (kept.pixels % step == 0).all(axis=1)
    return DepthScan(kept.points[rows], camera, kept.pixels[rows])


def _is_sure(file: Path, shape: tuple[int, ...]) -> np.ndarray:
    """Test which pixels (height, width) a sensor was sure of: above 0 of 2 (ARKit), above half of 255 (Polycam)."""
    values = read_picture(file, (".png", ".npy"), "mask")
    if values.shape != shape:
        raise ConfigError(f"{file}: its confidence has another size than the depth picture; remove it or export again.")
    return np.asarray(values > (0 if values.max(initial=0) <= 2 else 127))
