"""Depth pictures as scans: reading them, cutting out one object, back-projecting and merging views.

A depth picture holds the distance along the camera's viewing axis at every pixel (not along the ray).
"""

from __future__ import annotations

import os
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from PIL import Image

from kpred.errors import ConfigError, ScanError
from kpred.ops.typing import Bool, Float
from kpred.shapes.camera import Camera
from kpred.shapes.picture_file import has_soft_edges, lossy_mask, mask_channel, one_channel, read_picture
from kpred.shapes.scan import MINIMUM_POINTS

DEPTH_EXTENSIONS = (".png", ".npy", ".npz", ".tif", ".tiff", ".pgm", ".pfm")
_LOSSY = (".jpg", ".jpeg")
MASK_EXTENSIONS = (".png", ".npy", ".npz", ".tif", ".tiff", ".pgm", ".bmp", ".gif", ".webp", *_LOSSY)

MILLIMETRES = 1000.0
"""Units per metre of whole-number depth pictures when nothing else is said."""

MAX_DEPTH = 10.0
"""Metres beyond which depth sensors only guess."""

VOXEL = 0.005
"""Metres: of several views' points in a cube of this side, one stays."""

_MAX_STEP = 12.0
"""Steps of depth from pixel to pixel above this many pixel widths are edges: a surface seen at 85 degrees or more."""

_SUPPORT = 2
"""Neighbours, of eight, that a pixel needs on its own surface."""


@dataclass(frozen=True, eq=False)
class DepthScan:
    """What one depth picture shows of an object.

    Attributes:
        points: (N, 3) float64 metres, in the world frame of the camera.
        camera: that took it; its `origin` is the sensor's place, from which nothing hid the points.
        pixels: (N, 2) int64 as (column, row), the pixel of each point.
    """

    points: Float[np.ndarray, "points 3"]
    camera: Camera
    pixels: np.ndarray

    @property
    def origin(self) -> Float[np.ndarray, "3"]:
        """(3,) place of the sensor in the world."""
        return self.camera.origin


@dataclass(frozen=True, eq=False)
class MergedScan:
    """Several depth pictures of one object in one world frame.

    Attributes:
        points: (N, 3) float64 metres.
        views: (N,) int64, which of `scans` saw each point.
        scans: the single views, all their points kept.
    """

    points: Float[np.ndarray, "points 3"]
    views: np.ndarray
    scans: tuple[DepthScan, ...]

    @property
    def origins(self) -> Float[np.ndarray, "views 3"]:
        """(views, 3) places of the sensor."""
        return np.stack([scan.origin for scan in self.scans])


def read_depth(
    path: str | os.PathLike[str], depth_scale: float | None = None, units_per_metre: float | None = None
) -> Float[np.ndarray, "height width"]:
    """Read a depth picture, (height, width) float64 metres; 0 where the sensor saw nothing.

    Whole numbers (16-bit .png or .tiff, integer .npy) are millimetres and their type's highest value means nothing was
    seen; fractions (.tiff, .npy of floats) are metres. `depth_scale` says otherwise for both: units per metre;
    `units_per_metre`, as a camera's file names it, for whole numbers alone.

    Raises:
        ScanError: missing, unreadable, or no depth picture (8 bits, colours, another shape).
        ConfigError: `depth_scale` is not a positive number.
    """
    if depth_scale is not None and not (np.isfinite(depth_scale) and depth_scale > 0):
        raise ConfigError(f"depth_scale is {depth_scale}; it must be a positive number of units per metre.")
    file = Path(path)
    array = one_channel(read_picture(file, DEPTH_EXTENSIONS, "depth picture"))
    if array.ndim != 2 or array.dtype == bool or array.dtype.itemsize == 1:
        raise ScanError(
            f"{file}: it is no depth picture (shape {array.shape}, {array.dtype}); save depth as one 16-bit channel in "
            "millimetres, or as floats in metres."
        )
    if array.dtype.kind == "f":
        depth = array.astype(np.float64) / (depth_scale or 1.0)
        return np.where(np.isfinite(depth) & (depth > 0), depth, 0.0)
    # Pillow may widen 16 bits to 32, so that the highest value decides.
    widened = array.dtype.itemsize > 2 and array.max(initial=0) <= 65535
    highest = 65535 if widened else np.iinfo(array.dtype).max
    depth = array.astype(np.float64) / (depth_scale or units_per_metre or MILLIMETRES)
    return np.where((array > 0) & (array < highest), depth, 0.0)


def write_depth(path: str | os.PathLike[str], depth: np.ndarray) -> None:
    """Write (height, width) metres as a 16-bit PNG of millimetres, rounded; 0 where nothing was seen or beyond 65 m.

    Raises:
        OutputError: the file cannot be written there.
    """
    from kpred.atomic import atomic_path

    values = np.nan_to_num(np.asarray(depth, dtype=np.float64) * MILLIMETRES, nan=0.0, posinf=0.0, neginf=0.0).round()
    picture = np.where((values > 0) & (values < 65535), values, 0).astype(np.uint16)
    with atomic_path(path) as temporary:
        Image.fromarray(picture).save(temporary, format="PNG")


def read_mask(path: str | os.PathLike[str], mask_id: int | None = None) -> Bool[np.ndarray, "height width"]:
    """Read the pixels of one object, (height, width) bool, from instance ids or a boolean array.

    Args:
        path: .png, .tiff or .pgm of whole numbers (palettes count by index), or .npy of booleans or whole numbers. Grey
            stored as colours is read as grey; of a cut-out photograph, the alpha channel.
        mask_id: the object's id; None takes all that is not 0, which must then be one object.

    Raises:
        ScanError: missing, unreadable, colours in place of ids, no pixel of that id, or several ids and none chosen.
    """
    file = Path(path)
    array = mask_channel(read_picture(file, MASK_EXTENSIONS, "mask"))
    if file.suffix.lower() in _LOSSY:
        array = lossy_mask(array, file)
    if array.ndim != 2 or array.dtype.kind not in "biu":
        raise ScanError(
            f"{file}: a mask is one channel of instance ids or booleans, but this is {array.dtype} of shape "
            f"{array.shape}; save it as one channel of whole numbers."
        )
    if mask_id is None and has_soft_edges(array):
        return np.asarray(array >= 128)
    ids = np.unique(array[array != 0]).tolist()
    named = ", ".join(str(int(number)) for number in ids[:12]) + (", ..." if len(ids) > 12 else "")
    if not ids:
        raise ScanError(f"{file}: the mask is empty; give one in which the object's pixels are not 0.")
    if mask_id is None:
        if len(ids) > 1:
            raise ScanError(f"{file}: the mask holds {len(ids)} objects ({named}); name one by its id (--mask-id).")
        return np.asarray(array != 0)
    chosen = np.asarray(array == mask_id)
    if mask_id == 0 or not chosen.any():
        raise ScanError(f"{file}: no object has the id {mask_id}; the mask holds {named}.")
    return chosen


def scan_depth(
    depth: np.ndarray,
    camera: Camera,
    mask: np.ndarray | None = None,
    *,
    nearest: float = 0.0,
    farthest: float = MAX_DEPTH,
    remove_flying: bool = True,
    name: str = "depth picture",
) -> DepthScan:
    """Back-project the valid pixels of a depth picture.

    Args:
        depth: (height, width) metres; 0, negative, NaN and infinite mean that nothing was seen.
        camera: of the same size.
        mask: (height, width) bool, the object's pixels; None takes all.
        nearest, farthest: metres; depths outside are dropped.
        remove_flying: drop pixels that mix front and back at the edge of an object (`flying_pixels`).
        name: what messages call it, usually the file.

    Raises:
        ScanError: sizes that do not match, or fewer than 64 pixels are left; the message counts why.
        ConfigError: an empty range of depths.
    """
    if not 0 <= nearest < farthest:
        raise ConfigError(f"The range of depths {nearest:g} to {farthest:g} is empty; give metres, the nearer first.")
    depth = np.asarray(depth, dtype=np.float64)
    for what, shape in (
        ("camera", (camera.height, camera.width)),
        ("mask", depth.shape if mask is None else mask.shape),
    ):
        if shape != depth.shape:
            raise ScanError(
                f"{name}: the depth picture has {_size(depth.shape)} pixels and the {what} {_size(shape)}; give a "
                f"{what} of the depth picture's size (masks: resized without interpolation)."
            )
    seen = np.isfinite(depth) & (depth > 0)
    within = seen & (depth >= nearest) & (depth <= farthest)
    kept = within & ~flying_pixels(np.where(within, depth, 0.0), camera) if remove_flying else within
    chosen = kept if mask is None else kept & mask
    if not seen.any():
        raise ScanError(f"{name}: no pixel has a depth; check the file and its depth scale.")
    if int(chosen.sum()) < MINIMUM_POINTS:
        where = np.ones_like(seen) if mask is None else np.asarray(mask)
        raise ScanError(
            f"{name}: {int(chosen.sum())} pixels show the object and at least {MINIMUM_POINTS} are needed: of "
            f"{int(where.sum())} {'in the mask' if mask is not None else 'in all'}, {int((where & seen).sum())} have a "
            f"depth, {int((where & within).sum())} lie between {nearest:g} and {farthest:g} m, and "
            f"{int((where & within & ~kept).sum())} were flying; check mask, depth scale and range."
        )
    rows, columns = np.nonzero(chosen)
    pixels = np.stack([columns, rows], axis=1)
    return DepthScan(camera.unproject(pixels, depth[rows, columns]), camera, pixels)


def flying_pixels(depth: Float[np.ndarray, "height width"], camera: Camera) -> Bool[np.ndarray, "height width"]:
    """Find pixels (height, width) bool that float between surfaces, with mixed depths of front and back.

    A pixel flies if it is a step on the way from a front to a back, steep on both sides of it along its row or column,
    or if fewer than two of its eight neighbours continue its surface. The border of an object, and a leg one pixel
    wide, is steep on its far sides only, and stays.

    Args:
        depth: (height, width) metres, 0 where nothing was seen.
    """
    seen = depth > 0
    padded = np.pad(np.where(seen, depth, np.nan), 1, constant_values=np.nan)
    width = depth / min(camera.intrinsics[0, 0], camera.intrinsics[1, 1])
    rise: dict[tuple[int, int], np.ndarray] = {}
    support = np.zeros(depth.shape, dtype=np.int64)
    for down in (-1, 0, 1):
        for across in (-1, 0, 1):
            if (down, across) != (0, 0):
                there = padded[1 + down : 1 + down + depth.shape[0], 1 + across : 1 + across + depth.shape[1]]
                steps = (there - depth) / np.where(seen, width, np.nan)
                rise[down, across] = steps
                support += np.abs(steps) <= _MAX_STEP * np.hypot(down, across)
    between = np.zeros_like(seen)
    for one, other in (((0, -1), (0, 1)), ((-1, 0), (1, 0))):
        between |= (rise[one] > _MAX_STEP) & (rise[other] < -_MAX_STEP)
        between |= (rise[one] < -_MAX_STEP) & (rise[other] > _MAX_STEP)
    return seen & (between | (support < _SUPPORT))


def merge_views(scans: Sequence[DepthScan], voxel: float = VOXEL) -> MergedScan:
    """Merge the points of all views, one in each cube of side `voxel` metres (0 keeps all).

    Of the points in a cube the one nearest to its own camera stays, since the noise of depth grows with distance. The
    points of a single view stay as they are.

    Raises:
        ConfigError: no views, or a negative voxel.
    """
    if not scans:
        raise ConfigError("There are no depth views to merge; give at least one.")
    if not (np.isfinite(voxel) and voxel >= 0):
        raise ConfigError(f"The voxel is {voxel}; it must be a length in metres, or 0 to keep all points.")
    points = np.concatenate([scan.points for scan in scans])
    views = np.repeat(np.arange(len(scans)), [len(scan.points) for scan in scans])
    if len(scans) > 1 and voxel > 0:
        distance = np.concatenate([np.linalg.norm(scan.points - scan.origin, axis=1) for scan in scans])
        cell = np.floor((points - points.min(axis=0)) / voxel).astype(np.int64)
        order = np.argsort(distance, kind="stable")
        _, first = np.unique(cell[order], axis=0, return_index=True)
        rows = np.sort(order[first])
        points, views = points[rows], views[rows]
    return MergedScan(points, views, tuple(scans))


def _size(shape: tuple[int, ...]) -> str:
    return " x ".join(str(side) for side in reversed(shape))
