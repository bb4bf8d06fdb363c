"""Intrinsics of depth cameras in the files of many programs, with the picture's size and the unit of its depths."""

from __future__ import annotations

import os
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from kpred.errors import ConfigError
from kpred.ops.typing import Float
from kpred.shapes.camera import check_intrinsics
from kpred.shapes.formats.keyed_content import dictionaries, numbers, read_keyed
from kpred.shapes.intrinsics_keys import (
    ANGLE_KEYS,
    AZURE_CROPS,
    AZURE_SENSOR,
    COLMAP_MODELS,
    FOCAL_AND_POINT,
    MATRIX_KEYS,
    NUMBER_KEYS,
    SCALE_KEYS,
    SIZE_KEYS,
)

_MIN_UNITS = 100.0
"""Units of depth in a metre, at least, for a key that may mean something else."""

Size = tuple[int, int]
"""Width and height in pixels."""


@dataclass(frozen=True, eq=False)
class IntrinsicsFile:
    """What a file says about a depth camera.

    Attributes:
        matrix: (3, 3) float64, pixels.
        size: of the pictures that the matrix is for; None where the file does not say.
        units_per_metre: of whole-number depth pictures; None where the file does not say.
    """

    matrix: Float[np.ndarray, "3 3"]
    size: Size | None = None
    units_per_metre: float | None = None


def read_intrinsics_file(path: str | os.PathLike[str], picture: Size | None = None) -> IntrinsicsFile:
    """Read the intrinsics of a depth camera; where the file describes several cameras, that of the `picture`'s size.

    Text: 3 x 3, 4 x 4 (ScanNet), `fx fy cx cy`, `width height fx fy cx cy` (ARKit pincam), COLMAP cameras, lines of
    `key = value` (ScanNet). JSON and YAML: fx, fy, cx, cy under the names of RealSense, ROS, nerfstudio, ORB-SLAM,
    Kalibr or Azure Kinect, or a matrix under intrinsic_matrix (Open3D, column by column), camera_matrix, K, ...
    NumPy: the matrix.

    Args:
        picture: size of the depth picture, where it is known.

    Raises:
        ConfigError: missing, unreadable, or not intrinsics.
    """
    file = Path(path)
    return intrinsics_of(file, read_keyed(file, "intrinsics"), picture)


def intrinsics_of(file: Path, content: Any, picture: Size | None = None) -> IntrinsicsFile:
    """Find the intrinsics in the content of a file; see `read_intrinsics_file`.

    Raises:
        ConfigError: there are none.
    """
    if isinstance(content, dict) or (isinstance(content, list) and content and isinstance(content[0], dict)):
        found = [(matrix, size) for _, matrix, size in sorted(_cameras(file, content, picture), key=lambda c: c[0])]
        scale = _scale(content)
    else:
        found, scale = _of_rows(file, content), None
    if not found:
        raise ConfigError(f"{file}: it names no intrinsics; give the keys fx, fy, cx and cy.")
    matrix, size = next((camera for camera in found if picture is not None and camera[1] == picture), found[0])
    return IntrinsicsFile(check_intrinsics(matrix, str(file)), size, scale)


def read_intrinsics(path: str | os.PathLike[str]) -> tuple[Float[np.ndarray, "3 3"], Size | None]:
    """Read intrinsics (3, 3) and the picture's size if the file names it; see `read_intrinsics_file`.

    Raises:
        ConfigError: missing, unreadable, or not intrinsics.
    """
    found = read_intrinsics_file(path)
    return found.matrix, found.size


def _cameras(file: Path, content: Any, picture: Size | None) -> Iterator[tuple[int, np.ndarray, Size | None]]:
    """Yield every camera in nested content with its rank: depth cameras first, colour cameras last."""
    outer = _sizes(file, content) if isinstance(content, dict) else {}
    for path, item in dictionaries(content):
        lowered = {str(key).lower(): value for key, value in item.items()}
        purpose = f"{path} {lowered.get('purpose', '')}".lower()
        rank = 0 if "depth" in purpose else 2 if any(word in purpose for word in ("color", "colour", "rgb")) else 1
        sizes = _sizes(file, item) or outer
        for names, suffix in NUMBER_KEYS:
            if all(_is_number(lowered.get(name)) for name in names):
                size = sizes.get(suffix, sizes.get("")) if suffix else sizes.get("", next(iter(sizes.values()), None))
                found = _of_numbers([float(lowered[name]) for name in names])
                yield rank + (1 if suffix == "color" else 0), found, size
                if not suffix:
                    break
        else:
            for focal, point in FOCAL_AND_POINT:
                values = (lowered.get(focal), lowered.get(point))
                if all(isinstance(value, list) and len(value) == 2 for value in values):
                    pairs = numbers(file, values)
                    size = next(iter(sizes.values()), None)
                    yield rank, _of_numbers([*pairs[0], *pairs[1]]), _turned(size, pairs[1])
            for name, suffix in MATRIX_KEYS:
                value = lowered.get(name)
                if isinstance(value, list) and value and not isinstance(value[0], dict):
                    size = sizes.get(suffix) or next(iter(sizes.values()), None)
                    yield rank, _of_array(file, numbers(file, value)), size
                    break
        size = sizes.get("", next(iter(sizes.values()), None))
        angle = next((lowered[name] for name in ANGLE_KEYS if _is_number(lowered.get(name))), None)
        if angle is not None and size is not None and "fl_x" not in lowered:
            yield rank, _of_angle(float(angle), size, is_degrees="camera_angle_x" not in lowered), size
        inner = lowered.get("intrinsics")
        model = {str(key).lower(): value for key, value in inner.items()} if isinstance(inner, dict) else {}
        if isinstance(model.get("modelparameters"), list):
            yield rank, *_azure(file, lowered | model, picture)


def _turned(size: Size | None, point: np.ndarray) -> Size | None:
    """Return width and height where a file names height and width (MATLAB), by the principal point."""
    if size is None:
        return None
    across, down = (max(abs(2 * point / np.array(order) - 1)) for order in (size, size[::-1]))
    return size if across <= down else (size[1], size[0])


def _of_rows(file: Path, content: Any) -> list[tuple[np.ndarray, Size | None]]:
    """Read the cameras of a file of numbers."""
    rows = content if isinstance(content, list) and content and isinstance(content[0], list) else [content]
    colmap = [row for row in rows if isinstance(row, list) and len(row) > 6 and str(row[1]) in COLMAP_MODELS]
    if colmap:
        cameras: list[tuple[np.ndarray, Size | None]] = []
        for row in colmap:
            values = numbers(file, row[2:]).tolist()
            single = COLMAP_MODELS[str(row[1])]
            focal = [values[2], values[2], *values[3:5]] if single else values[2:6]
            if len(focal) == 4:
                cameras.append((_of_numbers(focal), (int(values[0]), int(values[1]))))
        return cameras
    array = numbers(file, content)
    flat = array.ravel()
    # ARKit's pincam: the size comes first.
    if flat.size == 6 and array.shape in ((6,), (1, 6)) and (flat[:2] == flat[:2].round()).all() and flat[0] > 1:
        return [(_of_numbers(flat[2:].tolist()), (int(flat[0]), int(flat[1])))]
    return [(_of_array(file, array), None)]


def _of_angle(angle: float, size: Size, is_degrees: bool) -> np.ndarray:
    """Return intrinsics of square pixels from the horizontal field of view; the axis is in the picture's middle."""
    width, height = size
    focal = width / 2 / np.tan((np.radians(angle) if is_degrees else angle) / 2)
    return _of_numbers([focal, focal, width / 2, height / 2])


def _of_numbers(values: list[float]) -> np.ndarray:
    fx, fy, cx, cy = values
    return np.array([[fx, 0, cx], [0, fy, cy], [0, 0, 1]])


def _of_array(file: Path, array: np.ndarray) -> np.ndarray:
    """Read a matrix of four numbers, of nine or sixteen by rows or columns, or as it is."""
    if array.size == 4 and array.ndim == 1 or array.shape == (1, 4):
        return _of_numbers(array.ravel().tolist())
    if array.shape in ((9,), (16,), (1, 9), (1, 16)):
        side = 3 if array.size == 9 else 4
        square = array.reshape(side, side)
        # Open3D and ARKit write column by column: then the principal point stands where 0 0 must be.
        return square.T if square[2, 0] or square[2, 1] else square
    if array.shape == (3, 3) and (array[2, 0] or array[2, 1]) and not array[0, 2] and not array[1, 2]:
        return array.T
    return array


def _azure(file: Path, camera: dict[str, Any], picture: Size | None) -> tuple[np.ndarray, Size | None]:
    """Read Azure Kinect's calibration: cx, cy, fx, fy as fractions of the sensor, cropped by the depth mode."""
    values = numbers(file, {"p": camera["modelparameters"]}["p"]).ravel()
    if values.size < 4:
        raise ConfigError(f"{file}: its ModelParameters are incomplete; save the calibration again.")
    width = camera.get("sensorwidth") if _is_number(camera.get("sensorwidth")) else AZURE_SENSOR
    height = camera.get("sensorheight") if _is_number(camera.get("sensorheight")) else AZURE_SENSOR
    native, left, top = AZURE_CROPS.get(picture or (0, 0), (0, 0, 0))
    if "depth" in str(camera.get("purpose", "depth")).lower() and native:
        width = height = native
        size = picture
    else:
        size = (int(float(width or 0)), int(float(height or 0)))
    fx, fy = values[2] * float(width or 0), values[3] * float(height or 0)
    cx, cy = values[0] * float(width or 0) - left - 0.5, values[1] * float(height or 0) - top - 0.5
    return _of_numbers([fx, fy, cx, cy]), size


def _sizes(file: Path, item: dict[str, Any]) -> dict[str, Size]:
    """Read the sizes of pictures in one dictionary, by kind: depth, color, or unknown."""
    lowered = {str(key).lower(): value for key, value in item.items()}
    found: dict[str, Size] = {}
    for names, suffix in SIZE_KEYS:
        values = [lowered.get(name) for name in names]
        if len(names) == 1 and isinstance(values[0], list) and len(values[0]) == 2:
            values = values[0]
        if len(names) == 1 and isinstance(values[0], dict):
            values = [values[0].get("width"), values[0].get("height")]
        # ROS names a region of interest of 0 x 0 pixels where there is none.
        if len(values) != 2 or None in values or suffix in found or values == [0, 0]:
            continue
        if not all(_is_number(value) and float(value or 0) == int(float(value or 0)) > 0 for value in values):
            raise ConfigError(
                f"{file}: width and height must be whole numbers of pixels, not {values[0]!r} and {values[1]!r}."
            )
        found[suffix] = (int(float(values[0] or 0)), int(float(values[1] or 0)))
    return found


def _scale(content: Any) -> float | None:
    """Read the units per metre of whole-number depths, under any of several keys."""
    for _, item in dictionaries(content):
        lowered = {str(key).lower(): value for key, value in item.items()}
        for name in SCALE_KEYS:
            value = lowered.get(name)
            if _is_number(value) and value is not None and float(value) > 0:
                return _units_per_metre(float(value))
        # Replica; elsewhere a scale is that of the scene.
        if "fx" in lowered and _is_number(lowered.get("scale")) and float(lowered["scale"] or 0) > _MIN_UNITS:
            return float(lowered["scale"])
    return None


def _units_per_metre(value: float) -> float:
    """Convert a scale: above 1 units per metre (TUM), up to 0.01 metres per unit (RealSense), else BOP's."""
    if value > 1:
        return value
    return 1 / value if value <= 0.01 else 1000.0 / value


def _is_number(value: Any) -> bool:
    """Test whether this is a number, or text that contains one."""
    if isinstance(value, str) and len(value) < 40:
        try:
            return abs(float(value)) < 1e9
        except ValueError:
            return False
    return isinstance(value, int | float) and not isinstance(value, bool) and abs(value) < 1e9
