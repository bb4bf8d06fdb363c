"""Points of E57 files, all scans in the file's frame; read block by block by pye57 (the extra `e57`)."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from kpred.errors import ScanError
from kpred.shapes.formats.records import BLOCK_ROWS

_CARTESIAN = ("cartesianX", "cartesianY", "cartesianZ")
_SPHERICAL = ("sphericalRange", "sphericalAzimuth", "sphericalElevation")


def e57_points(path: Path, rows: int = BLOCK_ROWS) -> Iterator[np.ndarray]:
    """Yield (n, 3) float64 blocks, n <= `rows`, of the valid points of all scans of an E57 file, each by its pose.

    Raises:
        ScanError: pye57 is not installed, or the file is damaged or cut short, or holds no scans.
    """
    try:
        from pye57 import libe57
        from pye57.scan_header import ScanHeader
    except ImportError as error:
        raise ScanError(f"{path}: E57 needs pye57: pip install 'kpred[e57]', or save it as .las or .ply.") from error
    count = 0
    try:
        # pye57's own class of files deletes one that it cannot open.
        file = libe57.ImageFile(str(path), "r")
        try:
            root = file.root()
            scans = root["data3D"] if root.isDefined("data3D") else ()
            count = len(scans)
            for number in range(count):
                yield from _scan_points(libe57, file, ScanHeader(scans[number]), rows)
        finally:
            file.close()
    except GeneratorExit:
        raise
    except Exception as error:
        raise ScanError(f"{path}: it is not a readable E57 file (damaged or cut short); export it again.") from error
    if not count:
        raise ScanError(f"{path}: it holds no scans; export the point clouds of the project, not its pictures.")


def _scan_points(libe57: Any, file: Any, header: Any, rows: int) -> Iterator[np.ndarray]:
    """Yield blocks of the valid points of one scan, in the file's frame."""
    fields = set(header.point_fields)
    is_spherical = not set(_CARTESIAN) <= fields
    places = _SPHERICAL if is_spherical else _CARTESIAN
    invalid = "sphericalInvalidState" if is_spherical else "cartesianInvalidState"
    rows = max(1, min(rows, header.point_count))
    columns = {name: np.empty(rows) for name in places}
    if invalid in fields:
        columns[invalid] = np.zeros(rows)
    buffers = libe57.VectorSourceDestBuffer()
    for name, column in columns.items():
        buffers.append(libe57.SourceDestBuffer(file, name, column, rows, True, True))
    reader = header.points.reader(buffers)
    try:
        while count := reader.read():
            points = np.stack([columns[name][:count] for name in places], axis=1)
            if invalid in columns:
                points = points[columns[invalid][:count] == 0]
            yield _posed(_cartesian(points) if is_spherical else points, header)
    finally:
        reader.close()


def _cartesian(points: np.ndarray) -> np.ndarray:
    """Convert range, azimuth and elevation (N, 3), radians, to x, y and z."""
    distance, azimuth, elevation = points.T
    level = distance * np.cos(elevation)
    return np.stack([level * np.cos(azimuth), level * np.sin(azimuth), distance * np.sin(elevation)], axis=1)


def _posed(points: np.ndarray, header: Any) -> np.ndarray:
    """Rotate and move points (N, 3) by the pose of their scan, if it has one."""
    if not header.has_pose():
        return points
    moved: np.ndarray = points @ np.asarray(header.rotation_matrix).T + np.asarray(header.translation)
    return moved
